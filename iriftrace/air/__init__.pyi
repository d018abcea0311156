from .refractivity import Air as Air
from .refractivity import ciddor as ciddor
from .refractivity import dispersion as dispersion
from .refractivity import edlen as edlen

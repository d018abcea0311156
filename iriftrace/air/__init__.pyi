from .refractivity import Air as Air
from .refractivity import dispersion as dispersion

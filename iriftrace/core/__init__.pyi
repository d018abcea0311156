from .errors import InputError as InputError
from .errors import IriftraceError as IriftraceError
from .errors import IriftraceWarning as IriftraceWarning
from .errors import SetupError as SetupError
from .units import parse_quantity as parse_quantity

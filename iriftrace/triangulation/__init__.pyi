from .correct import Correction as Correction
from .correct import CorrectionStatus as CorrectionStatus
from .correct import correct as correct
from .features import Feature as Feature
from .features import fit_feature as fit_feature
from .scan import Scan as Scan
from .scan import ScanStatus as ScanStatus
from .scan import measure as measure

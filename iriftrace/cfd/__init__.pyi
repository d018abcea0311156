from .check.check import check_field as check_field
from .openfoam.simulate import simulate as simulate
from .synthetic.field import synthetic_field as synthetic_field
from .synthetic.mesh import AirMesh as AirMesh
from .synthetic.model import SyntheticAir as SyntheticAir
from .synthetic.model import synthetic_air as synthetic_air

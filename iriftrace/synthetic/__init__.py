"""Synthetic hot air around a part: a boundary layer and a plume from formulas, not a simulation."""

from iriftrace.synthetic.air_mesh import AirMesh, air_mesh, usual_mesh
from iriftrace.synthetic.field import synthetic_field, write_synthetic_field
from iriftrace.synthetic.model import SyntheticAir, laminar_boundary_layer_mm, synthetic_air
from iriftrace.synthetic.plume import Plume, plume_above

__all__ = [
    "AirMesh",
    "Plume",
    "SyntheticAir",
    "air_mesh",
    "laminar_boundary_layer_mm",
    "plume_above",
    "synthetic_air",
    "synthetic_field",
    "usual_mesh",
    "write_synthetic_field",
]

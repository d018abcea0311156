"""A mesh of the air around a part: fine at the wall and in the plume, coarse far away."""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.errors import InputError
from iriftrace.synthetic.bisection import graded_tetrahedra
from iriftrace.synthetic.model import SyntheticAir
from iriftrace.synthetic.wall_cut import CutMesh, cut_at_wall

FloatArray = NDArray[np.float64]

MOST_CELLS = 4_000_000

_CELLS_ACROSS_LAYER = 5.0
_GROWTH = 0.2
_CELLS_ACROSS_PLUME = 1.5
_SIDES_IN_LAYERS = 2.5
_HEIGHT_IN_SIZES = 2.0
_COARSEST_IN_WALL_CELLS = 16


@frozen
class AirMesh:
    """What is meshed around a part and how finely.

    Attributes
    ----------
    cell_mm : float
        Edge of the cubes at the wall, from whose division the cells come.
    sides_mm : float
        Air beside and below the part.
    height_mm : float
        Air above the part.
    """

    cell_mm: float
    sides_mm: float
    height_mm: float

    def __attrs_post_init__(self) -> None:
        """Refuse sizes that leave no air or no cells."""
        for name, value in (
            ("cell size", self.cell_mm),
            ("air beside the part", self.sides_mm),
            ("air above the part", self.height_mm),
        ):
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(f"The {name} is {value:g} mm; give a positive length.")


def usual_mesh(air: SyntheticAir) -> AirMesh:
    """Five cells across the boundary layer; air to where it has the room's temperature."""
    low, high = air.part.bounds
    height = _HEIGHT_IN_SIZES * float(high[2] - low[2]) + 4.0 * air.boundary_layer_mm
    sides = _SIDES_IN_LAYERS * air.boundary_layer_mm
    if air.plume is not None:
        # Where the bell has fallen to e^-9.
        top = 0.5 * (high[2] - low[2]) + height
        sides = max(sides, 3.0 * float(air.plume.half_width(np.array(top))))
    return AirMesh(air.boundary_layer_mm / _CELLS_ACROSS_LAYER, sides, height)


def air_mesh(air: SyntheticAir, size: AirMesh) -> CutMesh:
    """Cells around a part that end on its surface.

    Parameters
    ----------
    air : SyntheticAir
        The part, and where its air needs small cells.
    size : AirMesh

    Raises
    ------
    InputError
        More than `MOST_CELLS` cells would be needed, or they are larger than the boundary layer or
        pass over the part.
    """
    if size.cell_mm > air.boundary_layer_mm:
        raise InputError(
            f"Cells of {size.cell_mm:g} mm at the wall would miss the boundary layer, which is "
            f"{air.boundary_layer_mm:.3g} mm thick; give smaller ones (--cell-size), a fifth of it "
            "by default."
        )
    low, high = (np.array(bound, dtype=np.float64) for bound in air.part.bounds)
    low -= size.sides_mm
    high += size.sides_mm
    high[2] = air.part.bounds[1, 2] + size.height_mm
    coarsest = _COARSEST_IN_WALL_CELLS * size.cell_mm

    def size_at(points: FloatArray) -> FloatArray:
        distance = air.distance.nearest(points)[0]
        wanted = size.cell_mm + _GROWTH * np.maximum(distance - size.cell_mm, 0.0)
        if air.plume is not None:
            width = air.plume.half_width(points[:, 2] - air.plume.base[2])
            share = air.plume.excess(points)[0]
            fine = np.maximum(width / _CELLS_ACROSS_PLUME, size.cell_mm)
            # Where the plume has next to nothing left, there is nothing to resolve.
            wanted = np.where(share > 0.02, np.minimum(wanted, fine), wanted)
        return wanted

    mesh = graded_tetrahedra(low, high, coarsest, size_at, MOST_CELLS)

    def nearest(points: FloatArray) -> FloatArray:
        return air.distance.foot(points)

    cut = cut_at_wall(mesh, air.distance.inside, nearest)
    if not cut.on_wall.any():
        raise InputError(
            f"Cells of {size.cell_mm:.3g} mm at the wall see nothing of {air.part.path}, which is "
            f"{np.ptp(air.part.bounds, axis=0).min():.3g} mm thin; give smaller ones (--cell-size)."
        )
    return cut

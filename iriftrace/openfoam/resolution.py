"""How fine the mesh is: resolutions A to D of the paper's Table 1, for parts of any size."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.errors import InputError

Resolution = Literal["coarse", "normal", "fine", "extra-fine"]
RESOLUTIONS: tuple[str, ...] = get_args(Resolution)

WALL_LEVEL = 4
"""The background's cells are halved so many times at the wall, which makes a sixteenth."""

# Edges of the background's cells, mm, for the paper's cylinder, which is 27 mm high.
_BACKGROUND = {"coarse": 22.0, "normal": 17.0, "fine": 13.0, "extra-fine": 10.0}
_REFERENCE_HEIGHT = 27.0
_LETTERS = dict(zip(RESOLUTIONS, "ABCD", strict=True))

# Cells at the wall that the smallest extent of the part must hold, or its form would be lost.
_CELLS_ACROSS = 4


@frozen
class MeshSize:
    """Edge lengths of cells, mm, and what they are called in results."""

    name: str
    background: float

    @property
    def wall(self) -> float:
        """Edge of the cells at the wall."""
        return float(self.background / 2**WALL_LEVEL)


def mesh_size(
    resolution: str, extents: NDArray[np.float64], background_mm: float | None = None
) -> MeshSize:
    """Cells for a part.

    A boundary layer of natural convection grows with the fourth root of the height of the part
    (Nu ~ Ra^(1/4) for laminar flow), and so do the cells; a thin part gets finer ones.

    Parameters
    ----------
    resolution
        One of `RESOLUTIONS`.
    extents
        (3,) array, mm, along x, y and z.
    background_mm
        Edge of the background's cells in place of that of the resolution.

    Raises
    ------
    InputError
        The resolution is not known, or the cells are coarser than the part.
    """
    if resolution not in RESOLUTIONS:
        raise InputError(
            f'there is no resolution "{resolution}"; the resolutions are {", ".join(RESOLUTIONS)}.'
        )
    thinnest = float(min(extents))
    coarsest = thinnest / _CELLS_ACROSS * 2**WALL_LEVEL
    if background_mm is None:
        growth = (float(extents[2]) / _REFERENCE_HEIGHT) ** 0.25
        background = min(_BACKGROUND[resolution] * growth, coarsest)
        return MeshSize(f"{resolution} ({_LETTERS[resolution]})", background)
    if not 0.0 < background_mm <= coarsest:
        raise InputError(
            f"background cells of {background_mm:g} mm are no mesh for a part that is "
            f"{thinnest:g} mm thin: cells at the wall are a sixteenth and would lose its form; "
            f"give at most {coarsest:.3g} mm."
        )
    return MeshSize(f"background cells of {background_mm:g} mm", background_mm)

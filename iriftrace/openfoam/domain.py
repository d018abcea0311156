"""The box of air around the part, and where its mesh is fine."""

from __future__ import annotations

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.errors import InputError
from iriftrace.openfoam.footprint import plan_rectangles
from iriftrace.openfoam.resolution import WALL_LEVEL, MeshSize
from iriftrace.part import Part

FloatArray = NDArray[np.float64]

_SIDES, _ABOVE, _BELOW = 140.0, 300.0, 110.0
"""Air around a part of the size of the paper's cylinder, mm."""
_REFERENCE_LENGTH = 170.0

_KEPT_SIDES, _KEPT_ABOVE = 60.0, 150.0
"""Part of it that the field's file keeps: the lines of sight pass there."""

# A hundred times the cells that the finest resolution needs; all of them exist before any is cut.
_MOST_CELLS = 1e7

# Heights above the part's top at which the plume's temperature is watched, mm.
_PROBES = (20.0, 60.0, 100.0, 150.0, 200.0)


@frozen
class Box:
    """Cells in it are halved at least `level` times; `lower` and `upper` in mm, world."""

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    level: int


@frozen
class Domain:
    """The box of air that is computed; lengths in mm, world.

    Attributes
    ----------
    lower, upper
        Corners of the box.
    cells
        Cells of the background along x, y and z.
    planes
        Where the field is mirrored, ``{"x": 0.0}``; the box ends there.
    boxes
        Where the mesh is finer.
    distances
        Distance from the wall and level up to there, the nearest first.
    probes
        Points in the plume.
    point_in_air
        A point outside the part on no face of the background.
    kept_lower, kept_upper
        What the field's file keeps.
    """

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    cells: tuple[int, int, int]
    planes: dict[str, float]
    boxes: tuple[Box, ...]
    distances: tuple[tuple[float, int], ...]
    probes: tuple[tuple[float, float, float], ...]
    point_in_air: tuple[float, float, float]
    kept_lower: tuple[float, float, float]
    kept_upper: tuple[float, float, float]


def domain_around(part: Part, size: MeshSize, mirrors: str = "", margin: float = 1.0) -> Domain:
    """Lay out the air around a part.

    Parameters
    ----------
    part
        mm, world; gravity along -z.
    size
        Of the cells.
    mirrors
        Axes along which only the upper half is computed: "", "x", "y" or "xy".
    margin
        Factor on the air around the part.

    Raises
    ------
    InputError
        There would be too many cells.
    """
    low, high = part.bounds
    centre, half = part.centre, 0.5 * (high - low)
    scale = margin * max(1.0, 2.0 * float(half.max()) / _REFERENCE_LENGTH)
    sides = half[:2] + _SIDES * scale
    reach_up, reach_down = half[2] + _ABOVE * scale, half[2] + _BELOW * scale
    # Whole cells on both sides of the centre, so that a mirrored half has the same mesh.
    up = np.array([_whole(v, size.background) for v in (*sides, reach_up)])
    down = np.array([_whole(v, size.background) for v in (*sides, reach_down)])
    for axis, name in enumerate("xy"):
        if name in mirrors:
            down[axis] = 0.0
    _check_count((up + down) / size.background, size)
    lower, upper = centre - down, centre + up
    h, wall = size.background, size.wall
    # Whole cells as well, so that the field ends in planes.
    kept_down = np.array([_whole(v + _KEPT_SIDES * scale, h) for v in half])
    kept_up = kept_down.copy()
    kept_up[2] = _whole(half[2] + _KEPT_ABOVE * scale, h)
    # On no face of the background, and in no finer cell either.
    inside = upper - h * np.array([0.37, 0.37, 0.41])
    beside = 0.4 * wall
    return Domain(
        lower=_triple(lower),
        upper=_triple(upper),
        cells=_cells((up + down) / h),
        planes={name: float(centre["xy".index(name)]) for name in mirrors},
        boxes=_boxes(part, size, scale, float(upper[2])),
        distances=((max(5.0, 4 * wall), WALL_LEVEL), (max(14.0, 10 * wall), WALL_LEVEL - 1)),
        probes=tuple(
            _triple(np.array([centre[0] + beside, centre[1] + beside, high[2] + z * scale]))
            for z in _PROBES
        ),
        point_in_air=_triple(inside),
        kept_lower=_triple(centre - kept_down),
        kept_upper=_triple(centre + kept_up),
    )


def _check_count(cells: FloatArray, size: MeshSize) -> None:
    if cells.prod() > _MOST_CELLS:
        raise InputError(
            f"the air would have {cells.prod():.2g} background cells of {size.background:g} mm, "
            f"and many more at the wall, but {_MOST_CELLS:g} is the most; give larger ones "
            "(--background-cell, --resolution)."
        )


def _boxes(part: Part, size: MeshSize, scale: float, top: float) -> tuple[Box, ...]:
    """Near the part, far around it and in its plume, each finer than the last."""
    low, high = part.bounds
    plume_top = high[2] + (_KEPT_ABOVE + 22.0) * scale
    near = np.array([24.0, 24.0, 24.0]) * scale
    far = np.array([75.0, 75.0, 65.0]) * scale
    boxes = [
        Box(_triple(low - far), (*(high + far)[:2].tolist(), top), WALL_LEVEL - 3),
        Box(_triple(low - near), (*(high + near)[:2].tolist(), float(plume_top)), WALL_LEVEL - 2),
    ]
    for left, front, right, back in plan_rectangles(part, size.background / 2):
        bottom = float(part.centre[2])
        column = (right, back, float(plume_top))
        boxes.append(Box((left, front, bottom), column, WALL_LEVEL - 1))
    return tuple(boxes)


def _whole(length: float, cell: float) -> float:
    return float(np.ceil(length / cell - 1e-9) * cell)


def _triple(values: FloatArray) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 6) for value in values)
    return x, y, z


def _cells(values: FloatArray) -> tuple[int, int, int]:
    x, y, z = (round(float(value)) for value in values)
    return x, y, z

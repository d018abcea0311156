"""Box of air around the part, and the size of its cells."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.flow.simulate.draught import Lean
from iriftrace.part.part import Part

WALL_LEVEL = 4
"""Refinement level at the wall: the background's cells are halved this often, to a sixteenth."""
BODY_LEVEL = WALL_LEVEL - 2
"""Refinement level at the walls of other bodies; near the part their cells are finer."""
# Edges of the background's cells, mm, for the paper's cylinder, which is 27 mm high.
_BACKGROUND = {"coarse": 22.0, "normal": 17.0, "fine": 13.0, "extra-fine": 10.0}
_REFERENCE_HEIGHT = 27.0
RESOLUTIONS = tuple(_BACKGROUND)
# Cells at the wall that the smallest extent of the part must hold, or its form would be lost.
_CELLS_ACROSS = 4
_SIDES, _ABOVE, _BELOW = 140.0, 300.0, 110.0
"""Air around a part of the size of the paper's cylinder, mm."""
_REFERENCE_LENGTH = 170.0
_KEPT_SIDES, _KEPT_ABOVE = 60.0, 150.0
"""Piece of this air that is kept in the field's file: the lines of sight are in it."""
_KEPT_LEE = 50.0
"""Largest extension of it on a side to which plumes lean."""
# A hundred times the cells that the finest resolution needs; all exist before any is cut.
_MOST_CELLS = 1e7
# Heights above the part's top at which the plume's temperature is monitored, mm.
_PROBES = (20.0, 60.0, 100.0, 150.0, 200.0)


def plan_rectangles(part: Part, raster: float) -> list[tuple[float, float, float, float]]:
    """Cover every point of the part's plan with rectangles that do not overlap.

    They consist of squares of about `raster`, mm, and are (left, front, right, back), mm, world.
    """
    low, high = part.bounds
    origin = low[:2]
    counts = np.maximum(np.ceil((high[:2] - origin) / raster).astype(int), 1)
    step = (high[:2] - origin) / counts
    squares = _covered(part, origin, step, counts)
    found = []
    while squares.any():
        i, j = np.unravel_index(int(np.argmax(squares)), squares.shape)
        # A column as long as possible, then widened as long as all of it is covered.
        end = j + int(np.argmin(np.append(squares[i, j:], False)))
        last = i + 1
        while last < len(squares) and squares[last, j:end].all():
            last += 1
        squares[i:last, j:end] = False
        left, front = (origin + step * (i, j)).tolist()
        right, back = (origin + step * (last, end)).tolist()
        found.append((left, front, right, back))
    return found


def _covered(part: Part, origin: FloatArray, step: FloatArray, counts: IntArray) -> BoolArray:
    """(nx, ny) squares that a triangle of the part touches with one of its sample points."""
    corners = part.vertices[part.faces][:, :, :2]
    edges = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
    squares = np.zeros(counts, dtype=bool)
    # Samples closer than a third of a square; triangles of a similar size together.
    pieces = np.maximum(np.ceil(3.0 * edges / step.min()).astype(int), 1)
    for number in np.unique(pieces):
        i, j = np.mgrid[: number + 1, : number + 1].reshape(2, -1)
        i, j = i[i + j <= number], j[i + j <= number]
        weights = np.stack((number - i - j, i, j), axis=1) / number
        points = np.einsum("kc,fcd->fkd", weights, corners[pieces == number]).reshape(-1, 2)
        cells = np.clip(((points - origin) / step).astype(int), 0, counts - 1)
        squares[cells[:, 0], cells[:, 1]] = True
    return squares


@frozen
class MeshSize:
    """Edge lengths of cells, mm, and their description in results."""

    name: str
    background: float

    @property
    def wall(self) -> float:
        """Edge of the cells at the wall."""
        return float(self.background / 2**WALL_LEVEL)


def mesh_size(resolution: str, extents: FloatArray, background_mm: float | None = None) -> MeshSize:
    """Cells for a part with extents (3,), mm, along x, y and z; `background_mm` sets them instead.

    The thickness of a boundary layer of natural convection grows with the fourth root of the part's
    height (Nu ~ Ra^(1/4) for laminar flow), and so do the cells; a thin part gets finer ones.
    Raises InputError if the resolution is unknown, or the cells are coarser than the part.
    """
    if resolution not in RESOLUTIONS:
        raise InputError(
            f'there is no resolution "{resolution}"; the resolutions are {", ".join(RESOLUTIONS)}.',
            code="mesh.unknown_resolution",
            argument="resolution",
        )
    thinnest = float(min(extents))
    coarsest = _coarsest_for_shape(extents)
    if background_mm is None:
        background = min(_BACKGROUND[resolution] * _growth(extents), coarsest)
        letter = "ABCD"[RESOLUTIONS.index(resolution)]
        return MeshSize(f"{resolution} ({letter})", background)
    if not 0.0 < background_mm <= coarsest:
        raise InputError(
            f"background cells of {background_mm:g} mm are too coarse for a part that is "
            f"{thinnest:g} mm thin: cells at the wall are a sixteenth and would lose its shape; "
            f"give at most {coarsest:.3g} mm.",
            code="mesh.too_coarse",
            argument="background_cell",
        )
    return MeshSize(f"background cells of {background_mm:g} mm", background_mm)


def coarsest_useful(extents: FloatArray) -> float:
    """Largest background cells, mm, with which a part of extents (3,), mm, is worth simulating.

    Twice those of the coarse resolution: with cells of 2.6 mm at the paper's cylinder views that a
    plume does not cross differ by up to 8 % from those with 1.7 mm.
    """
    useful = 2.0 * _BACKGROUND["coarse"] * _growth(extents)
    return min(useful, _coarsest_for_shape(extents))


def _growth(extents: FloatArray) -> float:
    """Thickness of the boundary layer relative to that of the paper's cylinder."""
    return float((extents[2] / _REFERENCE_HEIGHT) ** 0.25)


def _coarsest_for_shape(extents: FloatArray) -> float:
    """Largest background cells, mm, that resolve the thinnest extent of the part."""
    return float(min(extents) / _CELLS_ACROSS * 2**WALL_LEVEL)


@frozen
class RefinementBox:
    """Cells in it are halved at least `level` times; `lower` and `upper` in mm, world."""

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    level: int


@frozen
class Domain:
    """The box of air that is computed; lengths in mm, world."""

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    cells: tuple[int, ...]  # of the background
    planes: dict[str, float]  # where the field is mirrored, {"x": 0.0}; the box ends there
    boxes: tuple[RefinementBox, ...]  # where the mesh is finer
    distances: tuple[tuple[float, int], ...]  # from the wall, nearest first, and level up to there
    probes: tuple[tuple[float, float, float], ...]  # in the plume
    point_in_air: tuple[float, float, float]  # on no face of the background
    kept_lower: tuple[float, float, float]  # of what the field's file keeps
    kept_upper: tuple[float, float, float]


def air_lengths(part: Part, margin: float = 1.0) -> FloatArray:
    """Width and depth of the air around a part, (2,) array, mm, before it is cut into cells."""
    return as_float64(np.ptp(part.bounds, axis=0)[:2] + 2.0 * _SIDES * _scale(part, margin))


def _scale(part: Part, margin: float) -> float:
    """Factor on the air around a part of the size of the paper's cylinder."""
    return margin * max(1.0, float(np.ptp(part.bounds, axis=0).max()) / _REFERENCE_LENGTH)


def domain_around(
    part: Part,
    size: MeshSize,
    mirrors: str = "",
    margin: float = 1.0,
    floor: float | None = None,
    leaning: Sequence[Lean] = (),
) -> Domain:
    """Lay out the air around a part, gravity along -z; InputError if there are too many cells.

    Along the axes in `mirrors` ("", "x", "y" or "xy") only the upper half is computed; `margin` is
    a factor on the air around the part, which ends at the height z of the `floor`, mm. The mesh is
    fine in plumes that rise straight up, and in those `leaning`.
    """
    low, high = part.bounds
    centre, half = part.centre, 0.5 * (high - low)
    scale = _scale(part, margin)
    h, wall = size.background, size.wall
    lower, upper, cells = _background(part, h, scale, mirrors, floor)
    # Whole cells as well, so that the field ends in planes.
    sides = _kept_sides(leaning)
    kept_down = _whole(half + scale * np.array((*sides[0], _KEPT_SIDES)), h)
    kept_up = _whole(half + scale * np.array((*sides[1], _KEPT_ABOVE)), h)
    kept_lower, kept_upper = centre - kept_down, centre + kept_up
    if floor is not None:
        height = (upper[2] - floor) / cells[2]
        ends = np.array((kept_lower[2], kept_upper[2]))
        kept_lower[2], kept_upper[2] = upper[2] - height * np.round((upper[2] - ends) / height)
        kept_lower[2] = max(kept_lower[2], floor)
    # On no face of the background, and in no finer cell either.
    inside = upper - h * np.array([0.37, 0.37, 0.41])
    above = np.array((centre[0] + 0.4 * wall, centre[1] + 0.4 * wall, high[2]))
    return Domain(
        lower=_triple(lower),
        upper=_triple(upper),
        cells=tuple(cells.round().astype(int).tolist()),
        planes={name: float(centre["xy".index(name)]) for name in mirrors},
        boxes=(
            *_boxes(part, size, scale, float(upper[2])),
            *_leaning_boxes(part, size, scale, scale * sides, leaning),
        ),
        distances=((max(5.0, 4 * wall), WALL_LEVEL), (max(14.0, 10 * wall), WALL_LEVEL - 1)),
        probes=tuple(_triple(above + np.array((0.0, 0.0, z * scale))) for z in _PROBES),
        point_in_air=_triple(inside),
        kept_lower=_triple(kept_lower),
        kept_upper=_triple(kept_upper),
    )


def _background(
    part: Part, cell: float, scale: float, mirrors: str, floor: float | None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Lowest and highest corner of the air, mm, and numbers of the background's cells in it."""
    half = 0.5 * np.ptp(part.bounds, axis=0)
    # Whole cells on both sides of the centre, so that a mirrored half has the same mesh.
    up = _whole(half + scale * np.array((_SIDES, _SIDES, _ABOVE)), cell)
    down = _whole(half + scale * np.array((_SIDES, _SIDES, _BELOW)), cell)
    for axis, name in enumerate("xy"):
        if name in mirrors:
            down[axis] = 0.0
    cells = (up + down) / cell
    if cells.prod() > _MOST_CELLS:
        raise InputError(
            f"the air would have {cells.prod():.2g} background cells of {cell:g} mm, "
            f"and many more at the wall, but {_MOST_CELLS:g} is the most; give larger ones, "
            "or compute a half or a quarter of a part that is symmetric.",
            code="mesh.too_many_cells",
            argument="background_cell",
        )
    lower, upper = part.centre - down, part.centre + up
    if floor is not None:
        bottom, lowest = float(part.bounds[0][2]), float(lower[2])
        if not lowest < floor <= bottom + 1e-6:
            raise InputError(
                f"a floor at z = {floor:g} mm is none for this part: it must not be above the "
                f"part's lowest point ({bottom:g} mm), nor below the air that is computed "
                f"({lowest:g} mm); check its sign and unit.",
                code="floor.outside",
                argument="floor",
            )
        lower[2] = floor
        # Cells that are a little lower or higher, so that whole ones stand on the floor.
        cells[2] = max(round((upper[2] - floor) / cell), 1)
    return lower, upper, cells


def _boxes(part: Part, size: MeshSize, scale: float, top: float) -> tuple[RefinementBox, ...]:
    """Near the part, far around it and in its plume, each finer than the last."""
    low, high = part.bounds
    bottom, plume_top = _plume_ends(part, scale)
    near = 24.0 * scale
    far = np.array([75.0, 75.0, 65.0]) * scale
    return (
        RefinementBox(_triple(low - far), (*(high + far)[:2].tolist(), top), WALL_LEVEL - 3),
        RefinementBox(
            _triple(low - near), (*(high + near)[:2].tolist(), plume_top), WALL_LEVEL - 2
        ),
        *(
            RefinementBox((left, front, bottom), (right, back, plume_top), WALL_LEVEL - 1)
            for left, front, right, back in plan_rectangles(part, size.background / 2)
        ),
    )


def _kept_sides(leaning: Sequence[Lean]) -> FloatArray:
    """Air that is kept around a part of usual size, mm: below and above it in x and y."""
    sides = np.full((2, 2), _KEPT_SIDES)
    for lean in leaning:
        reach = min(lean.most * _KEPT_ABOVE, _KEPT_LEE) * np.array(lean.downwind)
        sides = np.maximum(sides, _KEPT_SIDES + np.stack((-reach, reach)))
    return sides


def _leaning_boxes(
    part: Part, size: MeshSize, scale: float, sides: FloatArray, leaning: Sequence[Lean]
) -> Iterator[RefinementBox]:
    """Layers of boxes from a plume that rises to each that leans, in the air that is kept."""
    low, high = (bound[:2] for bound in part.bounds)
    bottom, top = _plume_ends(part, scale)
    ends = np.linspace(bottom, top, max(int((top - bottom) / size.background), 1) + 1)
    for lean, (below, above) in itertools.product(leaning, itertools.pairwise(ends)):
        reach = np.array(lean.downwind) * lean.most * (above - bottom)
        lower = low + np.maximum(np.minimum(reach, 0.0), -sides[0])
        upper = high + np.minimum(np.maximum(reach, 0.0), sides[1])
        yield RefinementBox(_triple((*lower, below)), _triple((*upper, above)), WALL_LEVEL - 1)


def _plume_ends(part: Part, scale: float) -> tuple[float, float]:
    """Heights z, mm, between which the mesh is fine in a plume."""
    return float(part.centre[2]), float(part.bounds[1][2] + (_KEPT_ABOVE + 22.0) * scale)


def _whole(lengths: FloatArray, cell: float) -> FloatArray:
    """Lengths as whole cells, up."""
    return np.ceil(lengths / cell - 1e-9) * cell


def _triple(values: Iterable[float]) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 6) for value in values)
    return x, y, z

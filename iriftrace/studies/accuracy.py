"""The study ``layers``: what the number of shells changes.

Against a stack of 20 shells with facet normals, the difference has a local maximum at six shells,
which is no property of six. By the outer rule shell k of N lies at the share k / N of the index
range, so all shells of 4, 5 or 10 are shells of the 20 too, with the same facets and the same
errors of these, which cancel. Six is the first number after a dip; against 24 shells the dips are
at 6, 8 and 12, and against the continuous engine, or with gradient normals, there are none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
import pyvista as pv
from attrs import evolve
from numpy.typing import NDArray

from iriftrace.core.arrays import IntArray
from iriftrace.core.errors import InputError
from iriftrace.field.index_field import IndexField
from iriftrace.image.differences import Hits
from iriftrace.shells.edit import smooth_taubin
from iriftrace.shells.stack import ShellStack
from iriftrace.studies.hit_comparison import (
    Axis,
    Comparison,
    Finest,
    check_references,
    references_of,
)
from iriftrace.studies.modes import CONTINUOUS, Mode, shells_of
from iriftrace.studies.picture import View, picture_of_field, picture_of_shells

LINEAR_CELLS = "linear cells"
THE_PAPERS = 20
"""Shells of the reference of Kern et al. (2025)."""


def layers_study(
    field: IndexField,
    view: View,
    layers: Sequence[int],
    modes: Sequence[Mode],
    references: Sequence[str],
    source: Mapping[str, Any],
) -> Comparison:
    """Compare numbers of shells with references.

    Parameters
    ----------
    field : IndexField
    view : View
    layers : sequence of int
        Numbers of shells.
    modes : sequence of Mode
    references : sequence of str
        ``"continuous"``: the continuous engine, the same for every mode. ``"linear cells"``:
        likewise, on the field that is linear in each cell, to which facet normals converge. A
        number: a stack of as many shells in the case's own mode; 20 is the paper's.
    source : mapping
        See :class:`iriftrace.studies.hit_comparison.Comparison`.

    Raises
    ------
    InputError
        If a number of shells is below 1, or a reference is unknown.
    """
    if any(count < 1 for count in layers):
        raise InputError(f"{min(layers)} shells bend no ray; give numbers of at least 1.")
    for mode in modes:
        mode.check_fields(1)
    for name in references:
        if name not in (CONTINUOUS, LINEAR_CELLS) and not (name.isdecimal() and int(name) > 0):
            raise InputError(
                f'"{name}" is no reference; give "{CONTINUOUS}", "{LINEAR_CELLS}" or a number of '
                f"shells, such as {THE_PAPERS}."
            )
    continuous: dict[str, Hits] = {}

    def shells(mode: Mode, count: int) -> Hits | None:
        stack = shells_of(field, count, mode)
        return None if stack is None else picture_of_shells(view, stack, mode)

    def reference(mode: Mode, name: str) -> Hits | None:
        if name.isdecimal():
            return shells(mode, int(name))
        if name not in continuous:
            normals = "gradient" if name == CONTINUOUS else "facet"
            continuous[name] = picture_of_field(view, field, normals=normals)
        return continuous[name]

    return Comparison(
        name="layers",
        axis=Axis("layers", tuple(layers), "number of shells"),
        modes=tuple(modes),
        references=tuple(references),
        trace=lambda mode, position: shells(mode, layers[position]),
        reference=reference,
        source=source,
    )


# MERGE studies.smoothing: The study ``smoothing``: what smoothing the shells of a coarse field ch


def smoothing_study(
    field: IndexField,
    finest: IndexField,
    view: View,
    iterations: Sequence[int],
    modes: Sequence[Mode],
    references: Sequence[str],
    source: Mapping[str, Any],
    *,
    layers: int = 13,
) -> Comparison:
    """Compare shells of one field, smoothed by Taubin's method, with those of a finer field.

    Parameters
    ----------
    field, finest : IndexField
        Smoothed, and left as it is; fields 0 and 1 for `Mode.drop_inner`.
    view : View
    iterations : sequence of int
        Of `iriftrace.shells.edit.smooth_taubin`.
    modes : sequence of Mode
        Gradient normals and steepness stay with their vertices, because they belong to the field
        and not to the facets.
    references : sequence of str
        See :mod:`iriftrace.studies.hit_comparison`.
    source : mapping
        See :class:`iriftrace.studies.hit_comparison.Comparison`.
    layers : int
        Number of shells.
    """
    for mode in modes:
        mode.check_layers(layers, 2)
    check_references(tuple(references))
    unsmoothed: dict[str, ShellStack | None] = {}
    target = Finest(finest, 1, layers)

    def trace(mode: Mode, position: int) -> Hits | None:
        if mode.name not in unsmoothed:
            unsmoothed[mode.name] = shells_of(
                field, layers, mode, number=0, index_range=target.index_range
            )
        stack = unsmoothed[mode.name]
        if stack is None:
            return None
        return picture_of_shells(view, smoothed(stack, iterations[position]), mode)

    return Comparison(
        name="smoothing",
        axis=Axis("iterations", tuple(iterations), "Taubin smoothing iterations"),
        modes=tuple(modes),
        references=tuple(references),
        trace=trace,
        reference=references_of(target, view),
        source={**source, "layers": layers},
    )


def smoothed(stack: ShellStack, iterations: int) -> ShellStack:
    """Smooth the surfaces; each vertex keeps the gradient that it had."""
    changed = smooth_taubin(stack, iterations)
    shells = [
        evolve(after, normals=before.normals, steepness=before.steepness)
        for before, after in zip(stack.shells, changed.shells, strict=True)
    ]
    return evolve(changed, shells=shells)


# MERGE studies.split_cells: Cells of a field cut smaller, without any new information about the a

TETRAHEDRON = 10

# Corner numbers 0 to 3 are the tetrahedron's own, 4 to 9 the middles of these edges.
_EDGES = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
_EIGHTHS = (
    *((0, 4, 5, 6), (4, 1, 7, 8), (5, 7, 2, 9), (6, 8, 9, 3)),
    # The octahedron in the middle, about the diagonal from edge 0-1 to edge 2-3.
    *((4, 9, 5, 6), (4, 9, 6, 8), (4, 9, 8, 7), (4, 9, 7, 5)),
)


def as_tetrahedra(field: IndexField) -> IndexField:
    """The same points and values with every cell divided into tetrahedra that share their faces.

    On tetrahedra the index is linear, on other cells it is not: surfaces of equal index differ
    between the two by the second order of the cells' size.
    """
    divided = field.grid.triangulate()
    corners = np.asarray(divided.cell_connectivity, dtype=np.int64).reshape(-1, 4)
    return _field(field, np.asarray(divided.points), field.refractivity, corners)


def split_tetrahedra(field: IndexField) -> IndexField:
    """Every tetrahedron divided into eight at the middles of its edges.

    The index at a new point is the mean of the edge's ends, which the field already had there; so
    surfaces of equal index stay where they are and get more triangles, all of them coplanar with
    those they come from. Recovered gradients change: the mean at a new point is taken over smaller
    cells, so that refining a linear field ever further gives back the steps of its gradient.

    Parameters
    ----------
    field : IndexField
        Of tetrahedra only.
    """
    corners = np.asarray(field.grid.cell_connectivity, dtype=np.int64).reshape(-1, 4)
    points = np.asarray(field.grid.points)
    ends = np.sort(corners[:, _EDGES].reshape(-1, 2), axis=1)
    key, edge = np.unique((ends[:, 0] << 32) | ends[:, 1], return_inverse=True)
    one, other = key >> 32, key & 0xFFFFFFFF
    middle = 0.5 * (points[one].astype(np.float64) + points[other])
    value = 0.5 * (field.refractivity[one] + field.refractivity[other])
    ten = np.concatenate((corners, len(points) + edge.reshape(-1, 6)), axis=1)
    return _field(
        field,
        np.concatenate((points.astype(np.float64), middle)),
        np.concatenate((field.refractivity, value)),
        ten[:, _EIGHTHS].reshape(-1, 4),
    )


def _field(
    field: IndexField, points: NDArray[np.floating], values: NDArray[np.float64], corners: IntArray
) -> IndexField:
    grid = pv.UnstructuredGrid({pv.CellType.TETRA: corners}, points)
    return IndexField(grid, values, field.air, field.source)


# MERGE studies.mesh: The study ``mesh``: what the resolution of the flow solution changes.

TETRAHEDRA = " as tetrahedra"
SPLIT = "+"


def mesh_study(
    fields: Mapping[str, IndexField],
    view: View,
    modes: Sequence[Mode],
    references: Sequence[str],
    source: Mapping[str, Any],
    *,
    layers: int = 13,
    split: Sequence[str] = (),
) -> Comparison:
    """Compare fields of several resolutions with the last of them, cut at the same levels.

    Parameters
    ----------
    fields : mapping
        Fields by name, the finest last.
    view : View
    modes : sequence of Mode
    references : sequence of str
        See :mod:`iriftrace.studies.hit_comparison`.
    source : mapping
        See :class:`iriftrace.studies.hit_comparison.Comparison`.
    layers : int
        Number of shells.
    split : sequence of str
        Names of fields that are also contoured after their cells were divided into tetrahedra
        (`TETRAHEDRA` is put after the name), and after these were split into eight (`SPLIT`).
        Between the last two only coplanar triangles are added.

    Raises
    ------
    InputError
        If there is one field only, or a name to split is none of theirs.
    """
    names = list(fields)
    if len(names) < 2:
        raise InputError(
            "A study of resolutions needs at least two fields, coarse to fine; give another one."
        )
    for name in split:
        if name not in fields:
            raise InputError(
                f"There is no field {name} to split; the study has {', '.join(names)}."
            )
    for mode in modes:
        mode.check_layers(layers, len(names))
    check_references(tuple(references))
    cases = [
        case
        for name in names
        for case in ((name, name + TETRAHEDRA, name + SPLIT) if name in split else (name,))
    ]
    target = Finest(fields[names[-1]], len(names) - 1, layers)

    # A split field can need gigabytes.
    @lru_cache(maxsize=1)
    def field_of(case: str) -> IndexField:
        if case in fields:
            return fields[case]
        if case.endswith(TETRAHEDRA):
            return as_tetrahedra(fields[case.removesuffix(TETRAHEDRA)])
        return split_tetrahedra(as_tetrahedra(fields[case.removesuffix(SPLIT)]))

    def trace(mode: Mode, position: int) -> Hits | None:
        case = cases[position]
        origin = case if case in fields else case.removesuffix(TETRAHEDRA).removesuffix(SPLIT)
        stack = shells_of(
            field_of(case),
            layers,
            mode,
            number=names.index(origin),
            index_range=target.index_range,
        )
        return None if stack is None else picture_of_shells(view, stack, mode)

    return Comparison(
        name="mesh",
        axis=Axis("field", tuple(cases), "field, coarse to fine"),
        modes=tuple(modes),
        references=tuple(references),
        trace=trace,
        reference=references_of(target, view),
        source={**source, "layers": layers},
    )

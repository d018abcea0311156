"""Shells: a field of hot air cut into layers along its own surfaces of equal index."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.core.arrays import Float32Array, FloatArray, IntArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.mesh.topology import drop_degenerate, face_along, weld
from iriftrace.core.mesh.triangles import normals_along, used_vertices
from iriftrace.medium.ambient import ambient_step
from iriftrace.medium.shells.hessian import derivative_rows
from iriftrace.medium.shells.levels import check_range, index_levels, layers_between
from iriftrace.medium.shells.options import STANDARD, ShellOptions
from iriftrace.medium.shells.stack import Shell, ShellStack
from iriftrace.medium.shells.table import SmallComponents

if TYPE_CHECKING:
    import pyvista as pv

    from iriftrace.medium.index_field import IndexField


def contour_shells(
    field: IndexField,
    layers: int = STANDARD.layers,
    *,
    index_range: tuple[float, float] | None = None,
    levels: Sequence[float] | None = None,
    rule: str = STANDARD.rule,
    min_size_mm: float = STANDARD.min_size,
) -> ShellStack:
    """Cut a field into layers along its own surfaces of equal index.

    The surfaces are contoured on the solver's cells without resampling, rounded to float32 (the
    precision of the renderer's geometry), welded, freed of degenerate triangles and of small
    components, and wound so that facets face the cooler air. Vertex normals are
    ``field.consistent_gradient``, interpolated along the cell edges and normalised. Each vertex
    has the derivatives of the index there (``field.hessian``), except with the rule ``"outer"``,
    which bends rays at the shells.

    Levels that the field does not reach are omitted with a warning; the other steps do not change.
    If a level in between has no triangles left (all its pieces are small), its step is added to the
    next shell inwards, so the steps still sum up to the difference of the layers.

    Parameters
    ----------
    field : IndexField
    index_range : (2,) tuple, optional
        n - 1 of the ambient and of the hottest air, so that studies over several fields use the
        same levels; by default the field's own.
    levels : sequence, optional
        n - 1 of the surfaces, in any order, instead of those of a rule. The layers follow from
        :func:`layers_between`.
    layers, rule, min_size_mm
        As in `ShellOptions`; see also :func:`index_levels`.

    Raises
    ------
    InputError
        Levels, range or size are wrong, or the field reaches no level.
    """
    ambient, hottest = index_range or (field.ambient_refractivity, field.hottest_refractivity)
    check_range(ambient, hottest)
    if levels is None:
        surfaces, e = index_levels(ambient, hottest, layers, rule)
    else:
        surfaces, e = layers_between(levels, ambient, hottest)
        rule = "custom"
    found, small = _large_surfaces(field, surfaces, min_size_mm)
    if not found:
        advice = _size_advice(field, min_size_mm)
        raise InputError(
            f"The field has no surface between n - 1 = {surfaces[0]:.6g} and {surfaces[-1]:.6g}; "
            f"check the index range, the levels and the ambient air.{advice}",
            code="shells.none",
            argument="field_length_unit" if advice else None,
        )
    _warn_of_missing(field, surfaces, found.keys())
    shells = []
    inside = None
    for layer, (vertices, faces, normals, per_mm) in found.items():
        ext = e[layer - 1] if inside is None else inside
        inside = float(e[layer])
        derivatives = None if rule == "outer" else per_mm / (ext - inside)
        level = float(surfaces[layer - 1])
        mesh = vertices, faces, normals, derivatives
        shells.append(Shell(layer, level, float(ext), inside, *mesh))
    return ShellStack(shells, field.air, rule, field.source, small)


def cut_shells(field: IndexField, options: ShellOptions = STANDARD) -> ShellStack:
    """Shells of a field (`contour_shells`), reduced to fewer triangles if that is an option."""
    stack = contour_shells(
        field,
        options.layers,
        index_range=options.ends(field.air),
        levels=options.levels,
        rule=options.rule,
        min_size_mm=options.min_size,
    )
    return reduced(stack, options)


def reduced(stack: ShellStack, options: ShellOptions) -> ShellStack:
    """Shells with fewer triangles, if that is an option."""
    from iriftrace.medium.shells.decimate import decimate

    return stack if options.triangles is None else decimate(stack, options.triangles)


_Mesh = tuple[Float32Array, IntArray, Float32Array, FloatArray]
"""Vertices, faces, normals, and derivatives of the index as `derivative_rows`."""


def _large_surfaces(
    field: IndexField, surfaces: FloatArray, min_size_mm: float
) -> tuple[dict[int, _Mesh], list[SmallComponents]]:
    """Surfaces by layer, if they have large components, and the small components removed."""
    import pyvista as pv

    ambient = field.ambient_refractivity
    step = ambient_step(field.refractivity, ambient)
    field = field.hot_air if (np.abs(surfaces - ambient) > step).all() else field
    # The field's cells with only the arrays that are interpolated along their edges.
    grid = pv.UnstructuredGrid()
    grid.copy_structure(field.grid)
    grid.point_data["refractivity"] = field.refractivity
    grid.point_data["gradient"] = field.consistent_gradient
    grid.point_data["hessian"] = field.hessian.reshape(-1, 9)
    found: dict[int, _Mesh] = {}
    small = []
    for layer, level in enumerate(surfaces.tolist(), start=1):
        vertices, faces, gradient, hessian = _contour(grid, level)
        towards = gradient[faces].mean(axis=1)
        faces, pieces, triangles = face_along(vertices, faces, towards, min_size_mm)
        small += [SmallComponents(layer, pieces, triangles)] if pieces else []
        if len(faces):
            used, faces = used_vertices(len(vertices), faces)
            vertices = vertices[used]
            gradient, hessian = gradient[used], hessian[used]
            normals = normals_along(vertices, faces, gradient)
            magnitude = np.linalg.norm(gradient, axis=1)
            found[layer] = vertices, faces, normals, derivative_rows(magnitude, hessian)
    return found, small


def _size_advice(field: IndexField, min_size_mm: float) -> str:
    """A field hardly larger than a small component was probably read in another unit."""
    size = float(np.linalg.norm(np.ptp(field.grid.points, axis=0)))
    if size > 20 * min_size_mm:
        return ""
    return (
        f" The whole field is {size:.3g} mm across and pieces below {min_size_mm:g} mm are "
        "dropped; if it is in metres, state this as its length unit."
    )


def _contour(
    grid: pv.UnstructuredGrid, level: float
) -> tuple[Float32Array, IntArray, FloatArray, FloatArray]:
    """One surface, welded: vertices, sound faces, and at the vertices gradient and Hessian."""
    surface = grid.contour([level], scalars="refractivity", method="contour")
    if surface.n_cells == 0:
        nothing = np.zeros((0, 3))
        return nothing.astype(np.float32), nothing.astype(np.int64), nothing, np.zeros((0, 3, 3))
    if not surface.is_all_triangles:
        surface = surface.triangulate()
    points = np.asarray(surface.points, dtype=np.float32)
    gradient = np.asarray(surface.point_data["gradient"], dtype=np.float64)
    faces = weld(points)[np.asarray(surface.regular_faces, dtype=np.int64)]
    hessian = np.asarray(surface.point_data["hessian"], dtype=np.float64)
    return points, drop_degenerate(points, faces), gradient, hessian.reshape(-1, 3, 3)


def _warn_of_missing(field: IndexField, surfaces: FloatArray, found: Iterable[int]) -> None:
    missing = [layer for layer in range(1, len(surfaces) + 1) if layer not in found]
    if missing:
        names = ", ".join(str(layer) for layer in missing)
        temperature = field.air.temperature(surfaces[np.array(missing) - 1])
        warn(
            f"No surface for level {names} ({np.min(temperature):.0f} to "
            f"{np.max(temperature):.0f} K): the field has no such air, or only pieces below the "
            "size limit; these shells are left out."
        )

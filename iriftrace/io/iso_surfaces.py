"""Iso-surfaces of COMSOL, ParaView and other programs as shells.

A file's triangles are read with the refractivity of each, split by value into surfaces, and each
surface is welded and turned towards the cooler air.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
from attrs import evolve, frozen
from scipy.spatial import cKDTree

from iriftrace.core.arrays import BoolArray, Float32Array, FloatArray, IntArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of
from iriftrace.core.mesh import transform as motion
from iriftrace.core.mesh.topology import drop_degenerate, face_along, weld
from iriftrace.core.mesh.triangles import area_vectors, normals_along, unit_vectors, used_vertices
from iriftrace.core.units import length_factor
from iriftrace.io.reading import FIELD_AS_STATED, ReadField
from iriftrace.io.refusals import check_ending, check_exists
from iriftrace.io.vtk_check import read_file
from iriftrace.io.vtk_files import blocks_of
from iriftrace.medium import arrays
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.marked import chosen_cells
from iriftrace.medium.origin import facts_of, origin_of
from iriftrace.medium.shells.levels import layers_between
from iriftrace.medium.shells.options import STANDARD
from iriftrace.medium.shells.stack import Shell, ShellStack
from iriftrace.medium.shells.table import SmallComponents
from iriftrace.medium.source import FieldFacts, FieldSource

SUFFIXES = (".vtu", ".vtm", ".vtp")

# Values of one surface differ only by rounding, those of two by a visible fraction of the range.
_SAME_SURFACE = 1e-4

_FLAT_CELLS = (5, 6, 7, 8, 9)
"""VTK's numbers of triangle, strip, polygon, pixel and quadrilateral."""


@frozen(eq=False)
class Soup:
    """Triangles of all surfaces of a file together, or of one of them."""

    vertices: Float32Array  # (n, 3), mm, world
    faces: IntArray  # (m, 3)
    refractivity: FloatArray  # (m,), n - 1 of every triangle's surface
    gradient: FloatArray | None  # (n, 3), along grad(n) at the vertices, with arbitrary length
    choice: arrays.UsedArray  # the array that was used
    origin: str  # what the file states about its origin; "" if nothing
    facts: FieldFacts


def import_shells(
    path: str | Path,
    reading: ReadField = FIELD_AS_STATED,
    *,
    gradient: str | None = None,
    air: Air | None = None,
    min_size_mm: float = STANDARD.min_size,
) -> ShellStack:
    """Read surfaces of equal temperature, density or index as shells.

    The triangles are split by value into shells. The layers between them follow from the midpoint
    rule reversed (:func:`iriftrace.medium.shells.contour.layers_between`): ambient outside, midway
    between neighbouring surfaces, and the same step again inside the innermost. The winding of the
    file is ignored: each piece is oriented towards the cooler air, by the gradient if the file has
    one, else by the neighbouring surfaces, else by its own centre.

    Parameters
    ----------
    path : path
        One ``.vtu``, ``.vtm`` or ``.vtp`` with triangles (or polygons) in mm or another unit.
    reading : ReadField
        Array, units and place. Array and quantity are needed where the name does not tell, as
        COMSOL's ``Color`` (:func:`iriftrace.medium.arrays.choose_array`).
    gradient : str, optional
        Name of a point array with the gradient of the same quantity, along which the shells get
        their normals; without one rays use the facets'.
    air : Air, optional
        Ambient air; ``Air()`` by default.
    min_size_mm : float, mm
        Pieces whose bounding box has a smaller diagonal are dropped.

    Returns
    -------
    ShellStack
        With rule ``"imported"``.

    Raises
    ------
    InputError
        The file is missing, damaged or has no triangles; array or quantity are not declared; the
        values are those of a continuous field; a surface does not lie between ambient and vacuum.

    Warns
    -----
    IriftraceWarning
        Neither the file nor `reading` states the unit of temperatures, which are read in K.
    """
    path = Path(path)
    air = Air() if air is None else air
    if reading.time is not None:
        raise InputError(
            f'the time is "{reading.time}", but a file of iso-surfaces is read as a whole; export '
            "the surfaces of one time.",
            code="shells.time",
            argument="time",
        )
    soup = _read_triangles(path, reading, gradient, air)
    surfaces, of_triangle = _split(soup.refractivity, soup.choice.name, path)
    _, e = layers_between(surfaces, air.ambient_refractivity)
    meshes = [_mesh(soup, of_triangle == k) for k in range(len(surfaces))]
    shells, small = [], []
    for k, mesh in enumerate(meshes):
        neighbours = (meshes[i].vertices if 0 <= i < len(meshes) else None for i in (k - 1, k + 1))
        towards = _outward(mesh, *neighbours)
        faces, pieces, triangles = face_along(mesh.vertices, mesh.faces, towards, min_size_mm)
        small += [SmallComponents(k + 1, pieces, triangles)] if pieces else []
        if len(faces) == 0:
            raise InputError(
                f"All pieces of the surface at n - 1 = {surfaces[k]:.6g} in {path} are smaller "
                f"than {min_size_mm:g} mm; check the length unit or allow smaller pieces.",
                code="shells.too_small",
                argument="min_size",
            )
        used, faces = used_vertices(len(mesh.vertices), faces)
        vertices, normals = mesh.vertices[used], None
        if mesh.gradient is not None:
            normals = normals_along(vertices, faces, mesh.gradient[used])
        level = float(surfaces[k])
        shells.append(Shell(k + 1, level, float(e[k]), float(e[k + 1]), vertices, faces, normals))
    source = FieldSource(
        path=str(path),
        sha256=sha256_of(path),
        array=soup.choice.name,
        quantity=soup.choice.quantity,
        length_unit=_unit(reading),
        origin=soup.origin,
        facts=soup.facts,
    )
    return ShellStack(shells, air, "imported", source, small)


def _split(refractivity: FloatArray, name: str, path: Path) -> tuple[FloatArray, IntArray]:
    """Values of the surfaces, from ambient inwards, and the surface of every triangle."""
    order = np.argsort(-refractivity, kind="stable")
    ranked = refractivity[order]
    tolerance = max(_SAME_SURFACE * float(np.ptp(ranked)), 1e-7 * float(ranked[0]))
    new = np.concatenate(([True], ranked[:-1] - ranked[1:] > tolerance))
    first = np.flatnonzero(new)
    last = np.append(first[1:], len(ranked)) - 1
    wide = np.any(ranked[first] - ranked[last] > 10.0 * tolerance)
    # A closed surface has at least four triangles, and a thousand of the smallest are unlikely.
    if wide or len(first) > max(1, len(ranked) // 4):
        raise _continuous(name, path)
    of_triangle = np.empty(len(ranked), dtype=np.int64)
    of_triangle[order] = np.cumsum(new) - 1
    return np.add.reduceat(ranked, first) / np.diff(np.append(first, len(ranked))), of_triangle


def _mesh(soup: Soup, chosen: BoolArray) -> Soup:
    """The triangles of one surface, welded, without degenerate ones."""
    used, faces = used_vertices(len(soup.vertices), soup.faces[chosen])
    vertices = soup.vertices[used]
    return evolve(
        soup,
        vertices=vertices,
        faces=drop_degenerate(vertices, weld(vertices)[faces]),
        refractivity=soup.refractivity[chosen],
        gradient=None if soup.gradient is None else soup.gradient[used],
    )


def _outward(mesh: Soup, cooler: Float32Array | None, hotter: Float32Array | None) -> FloatArray:
    """Direction to the cooler air at every triangle: the gradient, or from neighbours' vertices."""
    if mesh.gradient is not None:
        return as_float64(mesh.gradient[mesh.faces].mean(axis=1))
    here = mesh.vertices.astype(np.float64)[mesh.faces].mean(axis=1)
    direction: FloatArray = np.zeros_like(here)
    if hotter is not None:
        direction += unit_vectors(here - hotter[cKDTree(hotter).query(here, workers=-1)[1]])
    if cooler is not None:
        direction += unit_vectors(cooler[cKDTree(cooler).query(here, workers=-1)[1]] - here)
    if cooler is None and hotter is None:
        areas = np.linalg.norm(area_vectors(mesh.vertices, mesh.faces), axis=1)
        direction += here - np.average(here, axis=0, weights=areas)
    return direction


def _unit(reading: ReadField) -> str:
    return reading.length_unit or "mm"


def _read_triangles(path: Path, reading: ReadField, gradient: str | None, air: Air) -> Soup:
    """All triangles of a file; the parameters are those of :func:`import_shells`."""
    factor, matrix = length_factor(_unit(reading)), reading.matrix
    blocks, origin, facts = _read(path)
    choice = arrays.choose_array(blocks[0], reading.array, reading.quantity, str(path))
    starts = np.cumsum([0] + [block.n_points for block in blocks])
    faces = [np.asarray(block.regular_faces, dtype=np.int64) for block in blocks]
    values = np.concatenate(
        [_triangle_values(b, f, choice.name, path) for b, f in zip(blocks, faces, strict=True)]
    )
    if not np.isfinite(values).all():
        raise InputError(
            f"The array {choice.name!r} in {path} has values that are not finite, so its surfaces "
            "have no index; export it without gaps.",
            code="shells.not_finite",
        )
    points = np.concatenate([np.asarray(b.points, dtype=np.float64) for b in blocks])
    points *= factor
    vectors = None
    if gradient is not None:
        # The index falls where the temperature rises.
        sign = -1.0 if choice.quantity == "temperature" else 1.0
        vectors = sign * np.concatenate([_vectors(block, gradient, path) for block in blocks])
    if matrix is not None:
        points = motion.apply(matrix, points)
        # A gradient is a covector: it turns with the inverse transposed.
        vectors = None if vectors is None else vectors @ np.linalg.inv(matrix[:3, :3])
    if not np.isfinite(points).all():
        raise InputError(
            f"{path} has points that are not finite numbers; export it again.",
            code="shells.not_finite",
        )
    unit = reading.temperature_unit
    refractivity = arrays.to_refractivity(values, choice, None, unit, air, str(path))
    # A wrong unit of a volume is noticed by its coolest air, which surfaces do not have.
    arrays.warn_of_unit(values, choice, None, unit, str(path), "temperature_unit")
    return Soup(
        vertices=points.astype(np.float32),
        faces=np.concatenate([f + start for f, start in zip(faces, starts, strict=False)]),
        refractivity=refractivity,
        gradient=vectors,
        choice=choice,
        origin=origin,
        facts=facts,
    )


def _read(path: Path) -> tuple[list[pv.PolyData], str, FieldFacts]:
    """Blocks of a file as triangles with their data, and what the file states: origin, facts."""
    check_exists(path)
    check_ending(path, SUFFIXES, "a file of surfaces")
    data = read_file(path)
    found = [mesh for mesh in map(_triangles, blocks_of(data)) if mesh is not None]
    if not found:
        raise InputError(
            f"{path} has no triangles; volume data are contoured by `iriftrace shells` instead.",
            code="shells.no_triangles",
        )
    return found, origin_of(data), facts_of(data) or FieldFacts()


def _triangles(block: pv.DataSet) -> pv.PolyData | None:
    if isinstance(block, pv.UnstructuredGrid):
        flat = np.flatnonzero(np.isin(block.celltypes, _FLAT_CELLS))
        if len(flat) == 0:
            return None
        block = chosen_cells(block, flat).extract_surface(algorithm="geometry")
    if not isinstance(block, pv.PolyData):
        return None
    mesh = block.triangulate()
    return mesh if mesh.n_cells else None


def _vectors(block: pv.PolyData, name: str, path: Path) -> FloatArray:
    if name not in block.point_data or block.point_data[name].shape[1:] != (3,):
        raise InputError(
            f"{path} has no gradient {name!r} with three components at the points; its point "
            f"arrays are {', '.join(block.point_data) or 'none'}.",
            code="shells.no_gradient",
        )
    return np.asarray(block.point_data[name], dtype=np.float64)


def _triangle_values(block: pv.PolyData, faces: IntArray, name: str, path: Path) -> FloatArray:
    if name in block.cell_data:
        return np.asarray(block.cell_data[name], dtype=np.float64)
    if name not in block.point_data:
        raise InputError(
            f"The array {name!r} is missing in a block of {path}; export it for all surfaces.",
            code="field.no_array",
            argument="array",
        )
    values = np.asarray(block.point_data[name], dtype=np.float64)
    tolerance = max(1e-3 * float(np.ptp(values)), 1e-6 * float(np.abs(values).max()))
    if np.any(np.ptp(values[faces], axis=1) > tolerance):
        raise _continuous(name, path)
    return as_float64(values[faces].mean(axis=1))


def _continuous(name: str, path: Path) -> InputError:
    """The error for triangles that are not iso-surfaces."""
    return InputError(
        f"The values of {name!r} in {path} change along the triangles, so they are not surfaces of "
        "equal value; export iso-surfaces, or contour the volume with `iriftrace shells`.",
        code="shells.not_iso",
    )

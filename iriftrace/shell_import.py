"""Ready-made iso-surfaces as shells, such as COMSOL and ParaView export them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from attrs import evolve
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from iriftrace.air import Air
from iriftrace.checksum import sha256_of
from iriftrace.errors import InputError
from iriftrace.index_field import FieldSource
from iriftrace.shell_levels import layers_between
from iriftrace.shell_mesh import (
    Float32Array,
    FloatArray,
    IntArray,
    area_vectors,
    drop_degenerate,
    face_along,
    normals_along,
    used_vertices,
    weld,
)
from iriftrace.shell_stack import Crumbs, Shell, ShellStack
from iriftrace.surface_file import Soup, continuous, read_surfaces
from iriftrace.triangles import unit_vectors
from iriftrace.units import length_factor

# Values of one surface differ by rounding only, values of two by a visible share of the range.
_SAME_SURFACE = 1e-4


def import_shells(
    path: str | Path,
    *,
    array: str | None = None,
    quantity: str | None = None,
    gradient: str | None = None,
    temperature_unit: str | None = None,
    length_unit: str = "mm",
    air: Air | None = None,
    transform: ArrayLike | None = None,
    min_size_mm: float = 1.0,
) -> ShellStack:
    """Read surfaces of equal temperature, density or index as shells.

    The triangles are split by value into shells. The layers between them follow from the midpoint
    rule reversed (:func:`iriftrace.shells.layers_between`): ambient outside, midway between
    neighbouring surfaces, and the same step again inside the innermost. The winding of the file is
    not trusted: each piece is turned so that it faces the cooler air, which the gradient tells
    where the file has one, else the neighbouring surfaces, else its own centre.

    Parameters
    ----------
    path : path
        One ``.vtu``, ``.vtm`` or ``.vtp`` with triangles (or polygons) in mm or ``length_unit``.
    array : str, optional
        Name of the point or cell array; found by its name, or because it is the only one.
    quantity : str, optional
        ``"temperature"``, ``"index"`` (n or n - 1) or ``"density"``. For a name that does not tell
        (COMSOL's ``Color``): temperature where all values exceed 150, index otherwise.
    gradient : str, optional
        Name of a point array with the gradient of the same quantity; by default the only array with
        three components whose name begins with "grad". Without one the shells have no normals and
        rays use the facets'.
    temperature_unit : str, optional
        Unit of the temperatures; what brackets in the array's name say, else K, when left out.
    length_unit : str
        Unit of the file's coordinates.
    air : Air, optional
        Ambient air; ``Air()`` when left out.
    transform : (4, 4) array_like, optional
        Applied to the coordinates after their conversion to mm.
    min_size_mm : float, mm
        Pieces whose bounding box has a smaller diagonal are dropped.

    Returns
    -------
    ShellStack
        With rule ``"imported"``.

    Raises
    ------
    InputError
        The file is missing, damaged or has no triangles; no array or several could be meant; the
        values are those of a continuous field; a surface does not lie between ambient and vacuum.
    """
    path = Path(path)
    air = Air() if air is None else air
    soup = read_surfaces(
        path,
        array,
        quantity,
        gradient,
        temperature_unit,
        length_factor(length_unit),
        air,
        transform,
    )
    surfaces, of_triangle = _split(soup.refractivity, soup.choice.name, path)
    _, e = layers_between(surfaces, air.ambient_refractivity)
    meshes = [_mesh(soup, of_triangle == k) for k in range(len(surfaces))]
    shells, crumbs = [], []
    for k, mesh in enumerate(meshes):
        neighbours = (meshes[i].vertices if 0 <= i < len(meshes) else None for i in (k - 1, k + 1))
        towards = _outward(mesh, *neighbours)
        faces, pieces, triangles = face_along(mesh.vertices, mesh.faces, towards, min_size_mm)
        crumbs += [Crumbs(k + 1, pieces, triangles)] if pieces else []
        if len(faces) == 0:
            raise InputError(
                f"All pieces of the surface at n - 1 = {surfaces[k]:.6g} in {path} are smaller "
                f"than {min_size_mm:g} mm; check the length unit or allow smaller pieces."
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
        length_unit=length_unit,
        origin=soup.origin,
    )
    return ShellStack(shells, air, "imported", source, crumbs)


def _split(refractivity: FloatArray, name: str, path: Path) -> tuple[FloatArray, IntArray]:
    """Values of the surfaces, from ambient inwards, and the surface of every triangle."""
    order = np.argsort(-refractivity, kind="stable")
    ranked = refractivity[order]
    tolerance = max(_SAME_SURFACE * float(np.ptp(ranked)), 1e-7 * float(ranked[0]))
    new = np.concatenate(([True], ranked[:-1] - ranked[1:] > tolerance))
    first = np.flatnonzero(new)
    last = np.append(first[1:], len(ranked)) - 1
    wide = np.any(ranked[first] - ranked[last] > 10.0 * tolerance)
    # A closed surface has at least four triangles, and nobody exports a thousand of the smallest.
    if wide or len(first) > max(1, len(ranked) // 4):
        raise continuous(name, path)
    of_triangle = np.empty(len(ranked), dtype=np.int64)
    of_triangle[order] = np.cumsum(new) - 1
    return np.add.reduceat(ranked, first) / np.diff(np.append(first, len(ranked))), of_triangle


def _mesh(soup: Soup, chosen: NDArray[np.bool_]) -> Soup:
    """The triangles of one surface, welded, without degenerate ones."""
    used, faces = used_vertices(len(soup.vertices), soup.faces[chosen])
    vertices = soup.vertices[used]
    return evolve(
        soup,
        vertices=vertices,
        faces=drop_degenerate(vertices, weld(vertices, faces)),
        refractivity=soup.refractivity[chosen],
        gradient=None if soup.gradient is None else soup.gradient[used],
    )


def _outward(mesh: Soup, cooler: Float32Array | None, hotter: Float32Array | None) -> FloatArray:
    """Direction to the cooler air at every triangle: the gradient, or from neighbours' vertices."""
    if mesh.gradient is not None:
        gradient: FloatArray = mesh.gradient[mesh.faces].mean(axis=1)
        return gradient
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

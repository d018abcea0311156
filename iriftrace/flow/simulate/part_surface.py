"""Part's surface for the mesher, and its mirror planes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv
import trimesh

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import whole_file
from iriftrace.medium.gradient import MIRRORED_CORNERS
from iriftrace.part.part import Part

_TOLERANCE = 5e-3
"""Largest distance of the mirrored surface from the part, as a fraction of its size."""
_SAMPLES = 20_000
"""Points of each kind that are mirrored; both take half a second with a million triangles."""


def write_stl(part: Part, path: Path, scale: float = 1e-3) -> None:
    """Write a part as binary STL, in metres or scaled otherwise from mm."""
    mesh = trimesh.Trimesh(scale * part.vertices, part.faces, process=False)
    with whole_file(path) as temporary:
        mesh.export(temporary, file_type="stl")


def symmetric_axes(part: Part) -> str:
    """Axes (of "xy") along which the part is symmetric about its centre."""
    return "".join(name for name in "xy" if is_symmetric(part, name, part.centre))


def check_mirrors(part: Part, mirrors: str) -> None:
    """Refuse mirror planes about which the part is not symmetric, with an InputError."""
    if mirrors not in ("", "x", "y", "xy"):
        raise InputError(
            f'there is no symmetry "{mirrors}"; give x, y, xy or none.',
            code="part.unknown_symmetry",
            argument="symmetry",
        )
    for name in mirrors:
        if not is_symmetric(part, name, part.centre):
            raise InputError(
                f"{part.path} is not symmetric about {name} = {part.centre['xy'.index(name)]:g} "
                f"mm, so half of the air is not enough; leave {name} out of the symmetry.",
                code="part.asymmetric",
                argument="symmetry",
            )


def is_symmetric(part: Part, name: str, centre: FloatArray) -> bool:
    """True if a surface is symmetric about the plane across the axis x or y at a centre, mm."""
    axis = "xy".index(name)
    points = np.concatenate((part.surface.corners, part.face_centres))
    points = points[:: len(points) // _SAMPLES + 1]
    # Large triangles have neither corners nor a centre where the other side has a hole.
    even, _ = part.surface.even_places(_SAMPLES)
    size = float(np.ptp(part.bounds, axis=0).max())
    image = mirrored_points(np.concatenate((points, even)), axis, centre[axis])
    return float(part.surface.distance(image).max()) / size <= _TOLERANCE


def mirrored_points(points: FloatArray, axis: int, position: float) -> FloatArray:
    """Mirror images of points, (n, 3) array, mm, at the plane across an axis at a position, mm."""
    image = points.copy()
    image[:, axis] = 2.0 * position - image[:, axis]
    return image


def reflected_grid(grid: pv.UnstructuredGrid, axis: int, position: float) -> pv.UnstructuredGrid:
    """Mirror image of a grid at the plane across an axis at a position, mm; cells as below."""
    points = mirrored_points(np.array(grid.points, dtype=np.float64), axis, position)
    cells = {
        int(kind): np.asarray(corners, dtype=np.int64)[:, MIRRORED_CORNERS[int(kind)]]
        for kind, corners in grid.cells_dict.items()
    }
    image = pv.UnstructuredGrid(cells, points.astype(grid.points.dtype))
    for name in grid.point_data:
        values = np.array(grid.point_data[name])
        if values.ndim == 2:
            values[:, axis] *= -1.0
        image.point_data[name] = values
    for name in grid.field_data:
        image.field_data[name] = grid.field_data[name]
    return image


def mirrored_grid(grid: pv.UnstructuredGrid, axis: int, position: float) -> pv.UnstructuredGrid:
    """A half and its mirror image as one grid, joined at the points in the plane at `position`, mm.

    Its cells are tetrahedra, hexahedra, wedges and pyramids, mm. The component of vectors in its
    point data across the plane changes its sign and is 0 in it.
    """
    points = np.array(grid.points, dtype=np.float64)
    # Points that are off the plane by a rounding error of the mesher belong to it.
    in_plane = np.abs(points[:, axis] - position) < 1e-3
    points[in_plane, axis] = position
    off_plane = np.flatnonzero(~in_plane)
    twin = np.arange(len(points))
    twin[off_plane] = len(points) + np.arange(len(off_plane))
    image = mirrored_points(points[off_plane], axis, position)
    cells: dict[int, IntArray] = {}
    for kind, corners in grid.cells_dict.items():
        turned = twin[np.asarray(corners, dtype=np.int64)][:, MIRRORED_CORNERS[int(kind)]]
        cells[int(kind)] = np.concatenate((corners, turned))
    whole = pv.UnstructuredGrid(cells, np.concatenate((points, image)))
    for name in grid.point_data:
        values = np.array(grid.point_data[name])
        reflected = values[off_plane]
        if values.ndim == 2:
            # Points in the plane have means of the cells on one side, which still move slightly.
            values[in_plane, axis] = 0.0
            reflected[:, axis] *= -1.0
        whole.point_data[name] = np.concatenate((values, reflected))
    return whole

"""Inner boundary of a field, where the air ends at the hot part."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.mesh.topology import connected, piece_boxes
from iriftrace.core.mesh.triangles import area_vectors, polydata

# Fraction of a larger area below which that of a cavity may be a gap between cells of different
# refinement, or a cell without a value.
_SMALLEST_SHARE = 1e-3
# Volume of a patch over its area to the power 3/2, below which it is flat up to rounding.
_FLAT = 1e-5


def inner_wall(grid: pv.UnstructuredGrid) -> pv.PolyData:
    """Triangles, mm, with a grid's point data, that face a cavity in it, which the part fills.

    The outer boundary may be stepped, as in data that were cropped cell by cell. Connected patches
    of boundary faces are classified by the volume they enclose: an outer boundary encloses the
    data, a wall encloses a region without data. If the part touches the outer boundary (a symmetry
    plane, a floor), faces in the sides of the data's bounding box are removed first, which
    separates the two. Cavities much smaller than the largest one are no walls. The wall is empty
    when the data have no inner boundary.
    """
    surface = grid.extract_surface(algorithm="geometry").triangulate()
    faces = np.asarray(surface.regular_faces, dtype=np.int64)
    inside = np.asarray(grid.cell_centers().points, dtype=np.float64)
    inside = inside[np.asarray(surface["vtkOriginalCellIds"])]
    points = np.asarray(surface.points, dtype=np.float64)
    # The order of a face's corners is unreliable: it is reversed in inverted and mirrored cells.
    areas = area_vectors(points, faces)
    side = np.einsum("ij,ij->i", areas, points[faces].mean(axis=1) - inside)
    areas = np.where(side[:, None] < 0.0, -areas, areas)

    kept = _wall_faces(points, faces, areas)
    size = np.linalg.norm(areas, axis=1)
    if size[kept].sum() < _SMALLEST_SHARE * size.sum():
        free = ~_on_box(points, faces)
        separated = np.zeros_like(kept)
        separated[free] = _wall_faces(points, faces[free], areas[free])
        kept = max(kept, separated, key=lambda mask: size[mask].sum())
    if not kept.any():
        return pv.PolyData()
    wall = polydata(points, faces[kept])
    for name in grid.point_data:
        wall.point_data[name] = surface.point_data[name]
    return wall.remove_unused_points()


def _wall_faces(points: FloatArray, faces: IntArray, areas: FloatArray) -> BoolArray:
    """Mask (m,) of the faces in patches that enclose a region without data."""
    if not len(faces):
        return np.zeros(0, dtype=bool)
    links = np.concatenate((faces[:, :2], faces[:, 1:]))
    patch = connected(links, len(points))[faces[:, 0]]
    patch = np.unique(patch, return_inverse=True)[1]
    low, high = piece_boxes(points, faces, patch)
    arm = points[faces].mean(axis=1) - 0.5 * (low + high)[patch]
    volume = np.bincount(patch, np.einsum("ij,ij->i", areas, arm))
    area = np.bincount(patch, np.linalg.norm(areas, axis=1))
    is_wall = volume < -_FLAT * area**1.5
    is_wall &= area > _SMALLEST_SHARE * area[is_wall].max(initial=0.0)
    mask: BoolArray = is_wall[patch]
    return mask


def _on_box(points: FloatArray, faces: IntArray) -> BoolArray:
    """Mask (m,) of the faces whose corners all lie in one side of the data's bounding box."""
    tolerance = 1e-5 * np.ptp(points, axis=0).max()
    mask = np.zeros(len(faces), dtype=bool)
    for bound in (points.min(axis=0), points.max(axis=0)):
        near = np.abs(points - bound) < tolerance
        mask |= near[faces].all(axis=1).any(axis=1)
    return mask

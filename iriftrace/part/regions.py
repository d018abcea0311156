"""Smooth patches of a surface, and names for the large ones."""

from __future__ import annotations

from collections import Counter

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.geometry.topology import Neighbours, connected

SMALLEST_SHARE = 0.01
"""A patch with less than this share of the area gets no region of its own."""

REST = "rest"
"""Name of the region that holds all smaller patches."""

# Length of the mean unit normal: 1 for a plane, smaller the more the patch curves. This limit
# corresponds to normals that spread by 2 degrees.
_PLANAR = np.cos(np.radians(2.0))
# Directions within 2.5 degrees of each other count as the same.
_SAME = np.cos(np.radians(2.5))


@frozen(eq=False)
class Regions:
    """Named regions of a surface.

    Attributes
    ----------
    of_face
        (m,) number of each face's region, an index into `names`.
    names
        The regions' names, unique.
    """

    of_face: IntArray
    names: tuple[str, ...]


def find_smooth_groups(neighbours: Neighbours, normals: FloatArray, angle_deg: float) -> IntArray:
    """Group faces that are connected without a sharp edge.

    Parameters
    ----------
    neighbours
        From `iriftrace.geometry.topology.find_neighbours`.
    normals
        (m, 3) unit normals; zero for a face without area, which joins nothing.
    angle_deg
        Faces whose normals differ by less are smoothly connected.

    Returns
    -------
    (m,) array
        Group numbers; group 0 holds face 0.
    """
    first, second = neighbours.pairs.T
    cosine = np.einsum("ij,ij->i", normals[first], normals[second])
    smooth = cosine > np.cos(np.radians(angle_deg))
    return connected(neighbours.pairs[smooth], len(normals))


def name_regions(groups: IntArray, normals: FloatArray, areas: FloatArray) -> Regions:
    """Make a region of every large smooth group and name it.

    Two opposite planes and one curved surface are the heads and the lateral surface of a cylinder:
    ``head -x``, ``head +x``, ``lateral``. Otherwise planes are called by their direction
    (``plane +z``) and curved surfaces ``surface``; with a number, the largest first, where several
    would have the same name. Groups below `SMALLEST_SHARE` of the area form the region ``rest``.

    Parameters
    ----------
    groups
        (m,) smooth group of each face.
    normals, areas
        (m, 3) unit normals and (m,) areas of the faces.
    """
    count = int(groups.max()) + 1
    area = np.bincount(groups, areas, minlength=count)
    sums = [np.bincount(groups, areas * component, minlength=count) for component in normals.T]
    mean = np.column_stack(sums) / np.maximum(area, np.finfo(float).tiny)[:, None]
    by_size = np.argsort(-area, kind="stable")
    # A surface in small components (a noisy scan) still has one region: all of it.
    large = by_size[area[by_size] >= SMALLEST_SHARE * area.sum()]
    region_of_group = np.full(count, len(large), dtype=np.int64)
    region_of_group[large] = np.arange(len(large))
    names = _names(mean[large])
    if len(large) < count:
        names.append(REST)
    return Regions(region_of_group[groups], tuple(names))


def _names(mean: FloatArray) -> list[str]:
    length = np.linalg.norm(mean, axis=1)
    planar = length > _PLANAR
    direction = mean / np.maximum(length, np.finfo(float).tiny)[:, None]
    heads = np.flatnonzero(planar)
    is_cylinder = (
        len(mean) == 3
        and len(heads) == 2
        and float(direction[heads[0]] @ direction[heads[1]]) < -_SAME
    )
    plane, curved = ("head", "lateral") if is_cylinder else ("plane", "surface")
    stems = [
        f"{plane}{_axis(vector)}" if flat else curved
        for flat, vector in zip(planar, direction, strict=True)
    ]
    # Numbered are those that occur more than once, and those that say nothing else.
    names, seen = [], Counter[str]()
    for stem in stems:
        seen[stem] += 1
        several = stems.count(stem) > 1 or stem in ("surface", "plane", "head")
        names.append(f"{stem} {seen[stem]}" if several else stem)
    return names


def _axis(direction: FloatArray) -> str:
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) < _SAME:
        return ""
    return f" {'+' if direction[axis] > 0 else '-'}{'xyz'[axis]}"

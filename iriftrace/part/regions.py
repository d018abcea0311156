"""Smooth patches of a surface, and names for the large ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.geometry.topology import Neighbours, connected

SMALLEST_SHARE = 0.01
"""A patch with a smaller fraction of the area does not become a region of its own."""

REST = "rest"
"""Name of the region that holds all smaller patches."""

# Single precision rounds areas in the seventh digit.
_SHARE_DIGITS = 5
# Length of the mean unit normal: 1 for a plane, smaller the more the patch curves. This limit
# corresponds to normals that spread by 2 degrees.
_PLANAR = np.cos(np.radians(2.0))
# The same spread of a cylinder's normals out of the plane across its axis, and of their sum.
_ACROSS = np.sin(np.radians(2.0))
# Corners of a cylinder lie on it, in single precision or to the deviation of a coarse tessellation.
_OFF_CIRCLE = 0.01
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
    """Group faces that are connected without a sharp edge: (m,) numbers; group 0 holds face 0.

    Neighbours are connected if their unit normals, (m, 3), differ by less than the angle; a face
    without area has a zero normal and is not connected.
    """
    first, second = neighbours.pairs.T
    cosine = np.einsum("ij,ij->i", normals[first], normals[second])
    smooth = cosine > np.cos(np.radians(angle_deg))
    return connected(neighbours.pairs[smooth], len(normals))


def name_regions(
    groups: IntArray, normals: FloatArray, areas: FloatArray, corners: FloatArray
) -> Regions:
    """Make a region of every large smooth group, (m,) number of each face's, and name it.

    Two opposite planes and one curved surface are the heads and the lateral surface of a cylinder:
    ``head -x``, ``head +x``, ``lateral``. Otherwise planes are called by their direction
    (``plane +z``), surfaces on a cylinder ``cylinder r 25`` or, seen from within, ``hollow r 25``,
    all around its axis ``hole 1 (x 43, y 0, r 7)`` with the place of an axis along x, y or z; other
    curved ones ``surface``. Equal names get a number, the largest region
    first. Lengths are mm. Groups below `SMALLEST_SHARE` of the area form the region ``rest``.

    The faces have unit normals (m, 3), areas (m,) and corners (m, 3, 3), mm.
    """
    count = int(groups.max()) + 1
    area = np.bincount(groups, areas, minlength=count)
    sums = [np.bincount(groups, areas * component, minlength=count) for component in normals.T]
    mean = np.column_stack(sums) / np.maximum(area, np.finfo(float).tiny)[:, None]
    # Equal holes are numbered in the order of the faces, however their corners were rounded.
    by_size = np.argsort(-np.round(area / area.sum(), _SHARE_DIGITS), kind="stable")
    # A surface in small components (a noisy scan) still has one region: all of it.
    large = by_size[area[by_size] >= SMALLEST_SHARE * area.sum()]
    region_of_group = np.full(count, len(large), dtype=np.int64)
    region_of_group[large] = np.arange(len(large))
    patches = (groups == number for number in large)
    names = _names(mean[large], [_round(normals[p], areas[p], corners[p]) for p in patches])
    if len(large) < count:
        names.append(REST)
    return Regions(region_of_group[groups], tuple(names))


def _names(mean: FloatArray, rounds: Sequence[_Round | None]) -> list[str]:
    length = np.linalg.norm(mean, axis=1)
    planar = length > _PLANAR
    direction = mean / np.maximum(length, np.finfo(float).tiny)[:, None]
    heads = np.flatnonzero(planar)
    is_cylinder = (
        len(mean) == 3
        and len(heads) == 2
        and float(direction[heads[0]] @ direction[heads[1]]) < -_SAME
    )
    kinds = []
    for flat, vector, found in zip(planar, direction, rounds, strict=True):
        if flat:
            kinds.append((f"{'head' if is_cylinder else 'plane'}{_axis(vector)}", ""))
        elif is_cylinder:
            kinds.append(("lateral", ""))
        else:
            kinds.append(("surface", "") if found is None else found.name)
    # Names that occur more than once, and names without other information, are numbered.
    names, seen = [], Counter[str]()
    stems = [stem for stem, _ in kinds]
    for stem, more in kinds:
        seen[stem] += 1
        several = stems.count(stem) > 1 or stem in ("surface", "plane", "head", "hole")
        names.append((f"{stem} {seen[stem]}" if several else stem) + more)
    return names


@frozen(eq=False)
class _Round:
    """Circular cylinder through a patch: direction and a point of its axis, radius, mm."""

    axis: FloatArray
    point: FloatArray
    radius: float
    hollow: bool
    whole: bool

    @property
    def name(self) -> tuple[str, str]:
        """Text before the number, and after it."""
        radius = f"r {_short(self.radius)}"
        if not (self.hollow and self.whole):
            return f"{'hollow' if self.hollow else 'cylinder'} {radius}", ""
        along = _axis(self.axis)[2:]
        # A slanted hole has no two coordinates of its own.
        across = [k for k, name in enumerate("xyz") if along and name != along]
        shown = [f"{'xyz'[k]} {_short(self.point[k])}" for k in across]
        return "hole", f" ({', '.join([*shown, radius])})"


def _round(normals: FloatArray, areas: FloatArray, corners: FloatArray) -> _Round | None:
    """The circular cylinder that a patch lies on, or None."""
    weights = areas / areas.sum()
    spread, axes = np.linalg.eigh(np.einsum("f,fi,fj->ij", weights, normals, normals))
    if spread[0] > _ACROSS**2:
        return None
    axis = axes[:, 0]
    middle = corners.mean(axis=(0, 1))
    flat = ((corners - middle) @ axes[:, 1:]).reshape(-1, 2)
    # Algebraic fit of a circle (Kasa 1976): exact where all points lie on one.
    terms = np.column_stack((2.0 * flat, np.ones(len(flat))))
    (u, v, rest), *_ = np.linalg.lstsq(terms, np.sum(flat**2, axis=1))
    distance = np.hypot(*(flat - (u, v)).T)
    radius = float(np.sqrt(max(rest + u * u + v * v, 0.0)))
    if np.abs(distance - radius).max() > _OFF_CIRCLE * radius:
        return None
    point = middle + axes[:, 1:] @ (u, v)
    outward = float(weights @ np.einsum("fi,fi->f", normals, corners.mean(axis=1) - point))
    around = float(np.linalg.norm(weights @ normals)) < _ACROSS
    return _Round(axis, point, radius, outward < 0.0, around)


def _short(length_mm: float) -> str:
    # Rounded first, so that -1e-17 becomes 0 and not -0.
    return f"{round(length_mm, 3) + 0.0:.4g}"


def _axis(direction: FloatArray) -> str:
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) < _SAME:
        return ""
    return f" {'+' if direction[axis] > 0 else '-'}{'xyz'[axis]}"

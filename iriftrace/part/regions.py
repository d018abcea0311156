"""Smooth patches of a surface, and names for the large ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.mesh.topology import Neighbours, connected

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
# The same for cones and spheres, which are fitted to the exact corners of any tessellation.
_OFF_CONE = 0.001
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
    groups: IntArray,
    normals: FloatArray,
    areas: FloatArray,
    vertices: FloatArray,
    faces: IntArray,
    smallest: float = SMALLEST_SHARE,
) -> Regions:
    """Make a region of every large smooth group, (m,) number of each face's, and name it.

    Two opposite planes and one curved surface are the heads and the lateral surface of a cylinder:
    ``head -x``, ``head +x``, ``lateral``. Otherwise planes are called by their direction
    (``plane +z``), surfaces on a cylinder ``cylinder r 25`` or, seen from within, ``hollow r 25``,
    all around its axis ``hole 1 (x 43, y 0, r 7)`` with the place of an axis along x, y or z;
    surfaces on a cone ``cone (90 deg, r 5 to 7)`` with its opening angle or, from within, ``hollow
    cone (x 43, y 0, 90 deg, r 5 to 7)``; on a sphere ``sphere r 25`` or ``hollow sphere r 25``;
    other curved ones ``surface``. Equal names get a number, the largest region first. Lengths are
    mm. Groups below the fraction `smallest` of the area form the region ``rest``.

    The faces (m, 3) have unit normals (m, 3) and areas (m,); vertices are (n, 3), mm.
    """
    count = int(groups.max()) + 1
    area = np.bincount(groups, areas, minlength=count)
    sums = [np.bincount(groups, areas * component, minlength=count) for component in normals.T]
    mean = np.column_stack(sums) / np.maximum(area, np.finfo(float).tiny)[:, None]
    # Equal holes are numbered in the order of the faces, however their corners were rounded.
    by_size = np.argsort(-np.round(area / area.sum(), _SHARE_DIGITS), kind="stable")
    # A surface in small components (a noisy scan) still has one region: all of it.
    large = by_size[area[by_size] >= smallest * area.sum()]
    region_of_group = np.full(count, len(large), dtype=np.int64)
    region_of_group[large] = np.arange(len(large))
    patches = (groups == number for number in large)
    shapes = [_shape(normals[p], areas[p], vertices[faces[p]]) for p in patches]
    names = _names(mean[large], shapes)
    if len(large) < count:
        names.append(REST)
    return Regions(region_of_group[groups], tuple(names))


def _names(mean: FloatArray, shapes: Sequence[tuple[str, str]]) -> list[str]:
    """Names of regions from their mean normals (n, 3) and the shapes of curved ones."""
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
    for flat, vector, shape in zip(planar, direction, shapes, strict=True):
        if flat:
            kinds.append((f"{'head' if is_cylinder else 'plane'}{_axis(vector)}", ""))
        elif is_cylinder:
            kinds.append(("lateral", ""))
        else:
            kinds.append(shape)
    # Names that occur more than once, and names without other information, are numbered.
    names, seen = [], Counter[str]()
    stems = [stem for stem, _ in kinds]
    for stem, more in kinds:
        seen[stem] += 1
        several = stems.count(stem) > 1 or stem in ("surface", "plane", "head", "hole")
        names.append((f"{stem} {seen[stem]}" if several else stem) + more)
    return names


def _shape(normals: FloatArray, areas: FloatArray, corners: FloatArray) -> tuple[str, str]:
    """Text before and after the number in the name of a curved patch."""
    weights = areas / areas.sum()
    return (
        _cylinder(normals, weights, corners)
        or _cone(normals, weights, corners)
        or _sphere(normals, weights, corners)
        or ("surface", "")
    )


def _cylinder(
    normals: FloatArray, weights: FloatArray, corners: FloatArray
) -> tuple[str, str] | None:
    """Name of a patch on a circular cylinder, or None."""
    spread, axes = np.linalg.eigh(np.einsum("f,fi,fj->ij", weights, normals, normals))
    if spread[0] > _ACROSS**2:
        return None
    middle = corners.mean(axis=(0, 1))
    centre, radius = _ball(((corners - middle) @ axes[:, 1:]).reshape(-1, 2), _OFF_CIRCLE)
    if radius is None:
        return None
    point = middle + axes[:, 1:] @ centre
    outward = float(weights @ np.einsum("fi,fi->f", normals, corners.mean(axis=1) - point))
    around = float(np.linalg.norm(weights @ normals)) < _ACROSS
    if outward < 0.0 and around:
        return "hole", f" ({_place(axes[:, 0], point)}r {_short(radius)})"
    return f"{'hollow' if outward < 0.0 else 'cylinder'} r {_short(radius)}", ""


def _cone(normals: FloatArray, weights: FloatArray, corners: FloatArray) -> tuple[str, str] | None:
    """Name of a patch on a circular cone, or None."""
    mean = weights @ normals
    off = normals - mean
    spread, axes = np.linalg.eigh(np.einsum("f,fi,fj->ij", weights, off, off))
    # All normals have one angle to the axis; those of a narrow strip do not determine it, and those
    # of a cylinder are across it.
    if spread[0] > _ACROSS**2 or spread[1] < _ACROSS**2 or abs(mean @ axes[:, 0]) < _OFF_CONE:
        return None
    # The planes of all faces meet in the apex.
    apex = np.linalg.lstsq(normals, np.einsum("fi,fi->f", normals, corners[:, 0]))[0]
    arms = (corners - apex).reshape(-1, 3)
    axis = axes[:, 0] * np.sign(arms.mean(axis=0) @ axes[:, 0])
    height = arms @ axis
    radius = np.linalg.norm(arms - np.outer(height, axis), axis=1)
    slope = float(radius @ height / (height @ height))
    if np.abs(radius - slope * height).max() > _OFF_CONE * radius.max():
        return None
    angle = 2.0 * np.degrees(np.arctan(slope))
    size = f"{angle:.4g} deg, r {_short(radius.min())} to {_short(radius.max())}"
    # The axis points to the wide end, normals of a solid cone to the apex.
    if mean @ axis < 0.0:
        return "cone", f" ({size})"
    around = float(np.linalg.norm(mean - (mean @ axis) * axis)) < _ACROSS
    return "hollow cone", f" ({_place(axis, apex) if around else ''}{size})"


def _sphere(
    normals: FloatArray, weights: FloatArray, corners: FloatArray
) -> tuple[str, str] | None:
    """Name of a patch on a sphere, or None."""
    centre, radius = _ball(corners.reshape(-1, 3), _OFF_CONE)
    if radius is None:
        return None
    outward = float(weights @ np.einsum("fi,fi->f", normals, corners.mean(axis=1) - centre))
    return f"{'hollow ' if outward < 0.0 else ''}sphere r {_short(radius)}", ""


def _ball(points: FloatArray, allowed: float) -> tuple[FloatArray, float | None]:
    """Centre and radius of the circle or sphere through points (n, 2 or 3).

    The radius is None if a distance differs from it by more than an allowed fraction.
    """
    # Algebraic fit (Kasa 1976): exact where all points lie on one.
    terms = np.column_stack((2.0 * points, np.ones(len(points))))
    found = np.linalg.lstsq(terms, np.sum(points**2, axis=1))[0]
    centre, rest = found[:-1], found[-1]
    radius = float(np.sqrt(max(rest + centre @ centre, 0.0)))
    off = np.abs(np.linalg.norm(points - centre, axis=1) - radius).max()
    return centre, radius if off <= allowed * radius else None


def _place(axis: FloatArray, point: FloatArray) -> str:
    """Coordinates of a hole along x, y or z; a slanted one has no two of its own."""
    along = _axis(axis)[2:]
    across = [k for k, name in enumerate("xyz") if along and name != along]
    return "".join(f"{'xyz'[k]} {_short(point[k])}, " for k in across)


def _short(length_mm: float) -> str:
    # Rounded first, so that -1e-17 becomes 0 and not -0.
    return f"{round(length_mm, 3) + 0.0:.4g}"


def _axis(direction: FloatArray) -> str:
    axis = int(np.argmax(np.abs(direction)))
    if abs(direction[axis]) < _SAME:
        return ""
    return f" {'+' if direction[axis] > 0 else '-'}{'xyz'[axis]}"

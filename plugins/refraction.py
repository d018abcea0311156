"""Geometrical optics at one triangle, in double precision Dr.Jit arrays.

Knows triangles, normals and indices, but no scene. Single precision would not do: the ratio of two
neighbouring indices is about 1.00001, and its seven digits leave only two of the deflection.
"""

from __future__ import annotations

from typing import Any, NamedTuple

GRAZING = 1e-9
"""Sine of the angle at which a ray leaves a triangle that it would not have left by itself."""


class Triangle(NamedTuple):
    """Corners of one triangle per ray (Point3d, mm, world)."""

    a: Any
    b: Any
    c: Any


def facet_normal(triangle: Triangle) -> Any:
    """Unit normal of the triangle's plane, counter-clockwise side (Vector3d)."""
    import drjit as dr

    return dr.normalize(dr.cross(triangle.b - triangle.a, triangle.c - triangle.a))


def distance_to_plane(
    origin: Any, direction: Any, triangle: Triangle, normal: Any, rough: Any, tolerance: Any
) -> Any:
    """Distance along a ray to the plane of a triangle, mm (Float64).

    Parameters
    ----------
    origin, direction : Point3d, Vector3d
    triangle : Triangle
    normal : Vector3d
        Unit normal of the plane.
    rough : Float64, mm
        Distance at which the single precision query met the triangle.
    tolerance : Float64, mm
        Error of that query across the ray. A ray that grazes a triangle's plane may meet the plane
        itself far from the triangle; so the result stays within what the query can be wrong by.
    """
    import drjit as dr

    cosine = dr.dot(direction, normal)
    # A ray parallel to the plane has no exact distance; one that lies in it would give NaN.
    exact = dr.select(cosine != 0, dr.dot(triangle.a - origin, normal) / cosine, rough)
    doubt = tolerance / dr.maximum(dr.abs(cosine), 0.01)
    return dr.clip(exact, rough - doubt, rough + doubt)


def interpolated_normal(point: Any, triangle: Triangle, normals: Triangle, facet: Any) -> Any:
    """Vertex normals interpolated linearly at a point of the triangle.

    Parameters
    ----------
    point : Point3d, mm
        A point of the triangle's plane; outside the triangle the nearest weights are used.
    triangle, normals : Triangle
        Corners, and the unit normals at them.
    facet : Vector3d
        Unit normal of the plane.

    Returns
    -------
    Vector3d
        Unit normal; the facet's own where the interpolated one vanishes.
    """
    import drjit as dr

    doubled_area = dr.dot(facet, dr.cross(triangle.b - triangle.a, triangle.c - triangle.a))
    to_point = point - triangle.a
    weight_b = dr.dot(facet, dr.cross(to_point, triangle.c - triangle.a)) / doubled_area
    weight_c = dr.dot(facet, dr.cross(triangle.b - triangle.a, to_point)) / doubled_area
    weight_b = dr.clip(weight_b, 0, 1)
    weight_c = dr.clip(weight_c, 0, 1 - weight_b)
    normal = normals.a * (1 - weight_b - weight_c) + normals.b * weight_b + normals.c * weight_c
    length = dr.norm(normal)
    return dr.select(length > 1e-3, normal / length, facet)


def _snell(direction: Any, normal: Any, ratio: Any) -> tuple[Any, Any]:
    """Refracted direction for a normal that faces the ray, and whether it exists."""
    import drjit as dr

    cos_in = -dr.dot(direction, normal)
    cos_out_squared = 1 - ratio * ratio * (1 - cos_in * cos_in)
    cos_out = dr.sqrt(dr.select(cos_out_squared > 0, cos_out_squared, 0))
    refracted = ratio * direction + (ratio * cos_in - cos_out) * normal
    return refracted, (cos_in > 0) & (cos_out_squared > 0)


def cross_surface(
    direction: Any, facet: Any, shading: Any | None, ratio: Any, outward: Any
) -> tuple[Any, Any]:
    """Direction behind a surface between two media, by Snell's law.

    The interpolated normal decides where there is one. If the direction it gives would leave the
    triangle on the side the ray came from, it is turned into the triangle's plane, by less than the
    deflection itself: falling back to the triangle's own normal would bend a ray that grazes a
    badly placed triangle by a hundred times too much. Only where Snell's law has no solution with
    the interpolated normal does the triangle's normal decide, and where neither has one the ray is
    totally reflected by the triangle.

    Parameters
    ----------
    direction : Vector3d
        Unit direction of the ray.
    facet, shading : Vector3d
        Unit normals: the triangle's, and the interpolated one (None: use the triangle's).
    ratio : Float64
        Index on the ray's side over index on the far side.
    outward : Bool
        The ray runs along the normals, not against them.

    Returns
    -------
    direction : Vector3d
        Unit direction of the refracted or totally reflected ray.
    reflected : Bool
        The ray is totally reflected and stays in its medium.
    """
    import drjit as dr

    facing = dr.select(outward, -facet, facet)
    refracted, exists = _snell(direction, facing, ratio)
    if shading is not None:
        # Coarse cells leave steps in a shell, whose risers a ray may cross backwards. There too the
        # step of the index acts along grad(n), so the normal faces the ray by itself: the crossings
        # of a step then cancel but for one, as they should.
        against = dr.select(dr.dot(direction, shading) > 0, -shading, shading)
        smooth, smooth_exists = _snell(direction, against, ratio)
        beyond = dr.maximum(dr.dot(smooth, facing) + GRAZING, 0)
        refracted = dr.select(smooth_exists, smooth - beyond * facing, refracted)
        exists |= smooth_exists
    mirrored = direction - 2 * dr.dot(direction, facing) * facing
    return dr.normalize(dr.select(exists, refracted, mirrored)), ~exists

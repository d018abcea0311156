"""Snell's law, plane hits and interpolated normals against independent float64 NumPy."""

from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from iriftrace.plugins.kernels.snell import (
    GRADUAL,
    GRAZING,
    Triangle,
    cross_surface,
    distance_to_plane,
    facet_normal,
    interpolated_normal,
)
from iriftrace.plugins.kernels.vertex_table import aligned, aligned_rows

pytestmark = pytest.mark.usefixtures("variant")

AIR = 1.0002718 / 1.0002553
UP = np.array((0.0, 0.0, 1.0))


def vectors(rows: Any) -> Any:
    """Vector3d from (n, 3) or (3,) numbers."""
    return mi.Vector3d(*aligned_rows(np.asarray(rows, dtype=np.float64)))


def points(rows: Any) -> Any:
    return mi.Point3d(*aligned_rows(np.asarray(rows, dtype=np.float64)))


def numbers(values: Any) -> Any:
    return mi.Float64(aligned(np.atleast_1d(np.asarray(values, dtype=np.float64))))


def rows(value: Any) -> np.ndarray:
    return np.array(value).T


def crossed(
    direction: Any, facet: Any, shading: Any, ratio: Any, outward: Any
) -> tuple[np.ndarray, np.ndarray]:
    """cross_surface with NumPy on both sides."""
    bent, reflected = cross_surface(
        vectors(direction),
        vectors(facet),
        None if shading is None else vectors(shading),
        numbers(ratio),
        mi.Bool(aligned(np.atleast_1d(outward))),
    )
    return rows(bent), np.broadcast_to(np.array(reflected), len(rows(bent)))


def downward(angle: np.ndarray, azimuth: np.ndarray | float = 0.3) -> np.ndarray:
    """Unit directions at an angle to -z, (n, 3)."""
    sine = np.sin(angle)
    return np.stack((sine * np.cos(azimuth), sine * np.sin(azimuth), -np.cos(angle)), axis=-1)


def triangle_of(corners: Any) -> Triangle:
    return Triangle(*(points(corner) for corner in np.asarray(corners, dtype=np.float64)))


def unit(values: np.ndarray) -> np.ndarray:
    return values / np.linalg.norm(values, axis=-1, keepdims=True)


@st.composite
def unit_vectors(draw: st.DrawFn) -> np.ndarray:
    """Evenly spread over the sphere."""
    z = draw(st.floats(-1, 1))
    azimuth = draw(st.floats(0, 2 * np.pi))
    radius = np.sqrt(1 - z * z)
    return np.array((radius * np.cos(azimuth), radius * np.sin(azimuth), z))


RATIOS = st.one_of(st.floats(0.9999, 1.0001), st.floats(0.5, 2.0))


@pytest.mark.parametrize("ratio", [AIR, 1 / AIR, 1 / 1.5, 1.0])
@pytest.mark.parametrize("smooth", [False, True])
def test_angles_follow_snell(ratio: float, smooth: bool) -> None:
    """sin(behind) = ratio sin(before), in the plane of incidence, for rays down and up."""
    angle = np.radians((0.0, 1e-3, 15.0, 45.0, 60.0, 85.0, 89.0, 89.7))
    behind = np.arcsin(np.minimum(ratio * np.sin(angle), 1))
    direction, expected = downward(angle), downward(behind)
    facet = np.tile(UP, (len(angle), 1))
    for sign, outward in ((1, False), (-1, True)):
        bent, reflected = crossed(
            sign * direction, facet, facet if smooth else None, np.full(len(angle), ratio), outward
        )
        possible = ratio * np.sin(angle) < 1
        assert not reflected[possible].any()
        np.testing.assert_allclose(bent[possible], sign * expected[possible], atol=2e-14)


def test_deflection_of_one_shell_keeps_ten_digits() -> None:
    """Single precision would keep two: the deflection of one shell is 1e-5 rad."""
    angle = np.radians(np.linspace(5, 85, 17))
    exact = np.arcsin(np.sin(angle) * AIR) - angle
    bent, _ = crossed(
        downward(angle), np.tile(UP, (17, 1)), None, np.full(17, AIR), np.zeros(17, bool)
    )
    turned = np.cross(downward(angle), bent)
    # Of (sin x, 0, -cos x) to x + e: the cross product has the length sin e.
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), np.sin(exact), rtol=1e-9)


@pytest.mark.parametrize("smooth", [False, True])
def test_rays_beyond_the_critical_angle_are_totally_reflected(smooth: bool) -> None:
    for ratio in (AIR, 1.5):
        critical = np.arcsin(1 / ratio)
        angle = critical + np.array((-1e-6, 1e-6, 0.5 * (np.pi / 2 - critical)))
        direction, facet = downward(angle), np.tile(UP, (3, 1))
        bent, reflected = crossed(
            direction, facet, facet if smooth else None, np.full(3, ratio), np.zeros(3, bool)
        )
        assert reflected.tolist() == [False, True, True]
        assert bent[0, 2] < 0
        np.testing.assert_allclose(bent[1:], direction[1:] * (1, 1, -1), atol=1e-15)


def test_a_ray_is_reflected_only_where_neither_normal_has_a_solution() -> None:
    """Rays that bounce between shells because of one of the two would ruin the mean."""
    ratio, lean = 1.5, 0.02
    critical = np.arcsin(1 / ratio)
    direction = downward(np.array([critical - 0.01]), 0.0)
    steeper, flatter = (np.array((s * np.sin(lean), 0.0, np.cos(lean))) for s in (1, -1))
    bent, reflected = crossed(direction, UP, steeper, ratio, False)
    plain, _ = crossed(direction, UP, None, ratio, False)
    assert not reflected[0]
    np.testing.assert_allclose(bent, plain, atol=1e-15)
    direction = downward(np.array([critical + 0.01]), 0.0)
    assert crossed(direction, UP, None, ratio, False)[1][0]
    assert crossed(direction, UP, steeper, ratio, False)[1][0]
    assert not crossed(direction, UP, flatter, ratio, False)[1][0]


@given(unit_vectors(), unit_vectors(), RATIOS)
def test_tangential_component_is_conserved(
    direction: np.ndarray, facet: np.ndarray, ratio: float
) -> None:
    """n1 t1 = n2 t2, and the result has length one."""
    outward = bool(direction @ facet > 0)
    assume(abs(direction @ facet) > 1e-3)
    bent, reflected = crossed(direction, facet, None, ratio, outward)
    assert np.linalg.norm(bent[0]) == pytest.approx(1, abs=1e-14)
    if not reflected[0]:
        before = direction - (direction @ facet) * facet
        after = bent[0] - (bent[0] @ facet) * facet
        np.testing.assert_allclose(after, ratio * before, atol=1e-13)


@given(unit_vectors(), unit_vectors(), unit_vectors(), RATIOS)
def test_a_ray_is_bent_along_the_interpolated_normal(
    direction: np.ndarray, facet: np.ndarray, lean: np.ndarray, ratio: float
) -> None:
    """It stays in the plane of itself and that normal, however the triangle lies.

    Where Snell's law has no solution with that normal, it may stay in the plane of the triangle's.
    """
    normal = unit(facet + 0.3 * lean)
    outward = bool(direction @ facet > 0)
    assume(abs(direction @ facet) > 1e-3)
    bent, reflected = crossed(direction, facet, normal, ratio, outward)
    assert np.linalg.norm(bent[0]) == pytest.approx(1, abs=1e-14)
    leaves = bent[0] @ (facet if outward else -facet)
    assert leaves > 0 or reflected[0]
    # Elsewhere the direction was turned into the triangle's plane or mirrored at it.
    if not reflected[0] and leaves > 2 * GRAZING:
        aside = [abs(np.cross(direction, n) @ bent[0]) for n in (normal, facet)]
        solvable = (direction @ normal) ** 2 > 1 - 1 / ratio**2
        assert (aside[0] if solvable else min(aside)) <= 1e-13


@pytest.mark.parametrize("angle", [10.0, 60.0, 80.0, 89.0, 90.0, 95.0, 130.0])
def test_triangles_of_noisy_cells_bend_like_the_mean_gradient(angle: float) -> None:
    """The mean push per length is the mean gradient, at every angle to it.

    The gradients of the cells scatter about the interpolated one, of length one; each cell has
    shells at right angles to its own gradient g, of which a ray d meets abs(g.d) / step per length.
    """
    count, step, scatter = 40_000, 1e-9, 0.3
    random = np.random.default_rng(5)
    cells = UP + random.normal(scale=scatter, size=(count, 3))
    direction = np.tile(-downward(np.radians(angle), 0.3), (count, 1))
    rate = np.einsum("ij,ij->i", cells, direction)
    outward = rate > 0
    ratio = np.where(outward, 1 / (1 + step), 1 + step)
    bent, reflected = crossed(direction, unit(cells), np.tile(UP, (count, 1)), ratio, outward)
    assert reflected.mean() < 1e-3
    pushes = (bent - direction) * np.abs(rate)[:, None] / step
    across = UP - (UP @ direction[0]) * direction[0]
    error = pushes.std(axis=0) / np.sqrt(count)
    # Snell's law with the interpolated normal scatters by scatter / cos(angle), without limit.
    assert np.linalg.norm(pushes.std(axis=0)) < scatter * (1 + 0.5 / GRADUAL)
    np.testing.assert_allclose(pushes.mean(axis=0), across, atol=4 * error.max() + 1e-6)


@given(unit_vectors(), unit_vectors(), unit_vectors(), st.sampled_from((AIR, 1 / AIR)))
def test_refraction_with_interpolated_normals_is_reversible(
    direction: np.ndarray, facet: np.ndarray, lean: np.ndarray, ratio: float
) -> None:
    """Push and stretch follow from the mean of the directions before and behind the triangle."""
    normal = unit(facet + 0.1 * lean)
    outward = bool(direction @ facet > 0)
    assume(abs(direction @ facet) > 0.2)
    bent, _ = crossed(direction, facet, normal, ratio, outward)
    back, _ = crossed(-bent, facet, normal, 1 / ratio, not outward)
    np.testing.assert_allclose(back[0], -direction, atol=1e-12)


def test_crossings_of_a_step_cancel_but_for_one() -> None:
    """A shell with a step: plateau inward, riser outward, plateau inward; grad(n) is vertical.

    The index acts along grad(n) at all three, so the ray behind them is that of one crossing, but
    for the share GRADUAL^2 / cos^2 of it.
    """
    direction = downward(np.array([np.radians(40)]), 0.0)
    riser = unit(np.array((1.0, 0.0, 0.1)))
    assert direction[0] @ riser > 0
    inside, _ = crossed(direction, UP, UP, 1 / AIR, False)
    deflection = np.linalg.norm(inside - direction)
    outside, reflected = crossed(inside, riser, UP, AIR, True)
    assert not reflected[0]
    np.testing.assert_allclose(outside, direction, atol=0.03 * deflection)
    again, _ = crossed(outside, UP, UP, 1 / AIR, False)
    np.testing.assert_allclose(again, inside, atol=0.03 * deflection)
    # The riser's own normal would bend the ray sideways instead.
    facet_only, _ = crossed(inside, riser, None, AIR, True)
    assert np.linalg.norm(facet_only - direction) > deflection


@pytest.mark.parametrize("ratio", [AIR, 1 / AIR])
@pytest.mark.parametrize("lean", [0.05, -0.05, 0.5, -0.5])
def test_a_ray_that_grazes_a_triangle_leaves_it_on_the_far_side(ratio: float, lean: float) -> None:
    """It dips by 1e-6 rad only; its deflection is never more than the triangle alone would cause,
    or the interpolated normal alone."""
    direction = np.array((np.cos(1e-6), 0.0, -np.sin(1e-6)))
    normal = unit(np.array((lean, 0.0, 1.0)))
    against = -np.sign(direction @ normal) * normal
    free, _ = crossed(direction, against, None, ratio, False)
    flat, flat_reflected = crossed(direction, UP, None, ratio, False)
    bent, reflected = crossed(direction, UP, normal, ratio, False)
    assert not reflected[0]
    assert bent[0, 2] <= -0.99 * GRAZING
    largest = np.linalg.norm(free - direction)
    if not flat_reflected[0]:
        largest = max(largest, np.linalg.norm(flat - direction))
    assert np.linalg.norm(bent - direction) <= 1.01 * largest + 1e-6


CORNERS = np.array(((1.0, 2.0, 3.0), (4.0, 2.5, 3.5), (1.5, 5.0, 2.0)))
FACET = unit(np.cross(CORNERS[1] - CORNERS[0], CORNERS[2] - CORNERS[0]))
NORMALS = unit(FACET + np.array(((0.1, 0.0, 0.2), (-0.2, 0.1, 0.0), (0.0, -0.3, 0.1))))


def interpolated(at: np.ndarray, normals: np.ndarray) -> np.ndarray:
    return rows(
        interpolated_normal(points(at), triangle_of(CORNERS), triangle_of(normals), vectors(FACET))
    )


@given(st.floats(0, 1), st.floats(0, 1))
def test_normals_are_interpolated_linearly(u: float, v: float) -> None:
    if u + v > 1:
        u, v = 1 - u, 1 - v
    weights = np.array((1 - u - v, u, v))
    np.testing.assert_allclose(
        interpolated(weights @ CORNERS, NORMALS)[0], unit(weights @ NORMALS), atol=1e-14
    )


@pytest.mark.parametrize(
    ("outside", "weights"),
    [
        ((1.4, -0.2, -0.2), (1, 0, 0)),
        ((-0.3, 1.2, 0.1), (0, 1, 0)),
        ((0.6, -0.3, 0.7), (0.3, 0, 0.7)),
    ],
)
def test_points_beyond_an_edge_take_weights_of_the_triangle(
    outside: tuple[float, ...], weights: tuple[float, ...]
) -> None:
    """A query in single precision can hit a triangle a little beside it; normals of weights
    outside 0..1 would be extrapolated."""
    found = interpolated(np.array(outside) @ CORNERS, NORMALS)[0]
    np.testing.assert_allclose(found, unit(np.array(weights) @ NORMALS), atol=1e-14)


@pytest.mark.parametrize(
    ("normals", "expected"),
    [
        (np.zeros((3, 3)), FACET),
        (NORMALS * ((0,), (1,), (0,)), NORMALS[1]),
        (np.stack((NORMALS[0], -NORMALS[0], np.zeros(3))), FACET),
    ],
    ids=["all zero", "two zero", "opposed"],
)
def test_vanishing_normals_give_the_facets(normals: np.ndarray, expected: np.ndarray) -> None:
    """Where the gradient is zero a file has (0, 0, 0)."""
    found = interpolated(np.array((0.4, 0.4, 0.2)) @ CORNERS, normals)[0]
    np.testing.assert_allclose(found, expected, atol=1e-14)


def distance(
    origin: np.ndarray, direction: np.ndarray, rough: float, tolerance: float = 1e-3
) -> float:
    found = distance_to_plane(
        points(origin),
        vectors(direction),
        triangle_of(CORNERS),
        vectors(FACET),
        numbers(rough),
        numbers(tolerance),
    )
    return float(found[0])


@given(unit_vectors(), st.floats(1, 500), st.floats(-3e-4, 3e-4))
def test_distance_to_the_plane_is_exact(direction: np.ndarray, length: float, error: float) -> None:
    """A query in single precision is off by 1e-5 of the distance; the plane is met exactly."""
    cosine = abs(direction @ FACET)
    assume(cosine > 0.01)
    hit = CORNERS.mean(axis=0)
    found = distance(hit - length * direction, direction, length + error / cosine)
    assert found == pytest.approx(length, abs=1e-12 * length / cosine)


@pytest.mark.parametrize("sign", [1, -1])
def test_distance_stays_within_what_a_query_can_be_wrong_by(sign: int) -> None:
    """A grazing ray meets the plane far away from where the query met the triangle."""
    along = unit(CORNERS[1] - CORNERS[0])
    direction = unit(along - 1e-6 * FACET)
    hit = CORNERS.mean(axis=0) + sign * 0.01 * FACET
    # To the plane it is 10 m more, or less; 0.01 is the smallest cosine that is reckoned with.
    assert distance(hit - 5 * direction, direction, 5.0) == pytest.approx(5 + sign * 1e-3 / 0.01)
    steep = unit(along - FACET)
    far = hit - 5 * steep
    assert distance(far, steep, 5.0) == pytest.approx(5 + sign * 1e-3 * np.sqrt(2))


@pytest.mark.parametrize("height", [0.0, 0.01, -0.01])
def test_ray_parallel_to_the_plane_keeps_the_querys_distance(height: float) -> None:
    """0 / 0 would make the ray NaN from there on. The plane is z = 0, so that cos is exactly 0."""
    flat = triangle_of(((0, 0, 0), (1, 0, 0), (0, 1, 0)))
    found = distance_to_plane(
        points((-1, 0.2, height)),
        vectors((1, 0, 0)),
        flat,
        facet_normal(flat),
        numbers(1.5),
        numbers(1e-3),
    )
    assert float(found[0]) == 1.5

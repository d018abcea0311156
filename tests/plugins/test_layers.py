"""Deflections of rays between shells against quadrature of media known everywhere."""

from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from iriftrace.plugins.kernels.between import (
    DIRECTION_ERROR,
    AtShell,
    beside_part,
    between_shells,
    length_gain,
    onto_plane,
    outside,
    stays_in_layer,
)
from iriftrace.plugins.kernels.vertex_table import aligned, aligned_rows

pytestmark = pytest.mark.usefixtures("variant")

AMBIENT = 1.00027
WIDTH_MM = 15.0
DEPTH = 1.5e-4
UNIFORM = (0.0, 0.0, 0.0)

angles = st.floats(0.0, 2.0 * np.pi)


def vectors(rows: Any) -> Any:
    """Vector3d from (n, 3) or (3,) numbers."""
    return mi.Vector3d(*aligned_rows(np.asarray(rows, dtype=np.float64)))


def numbers(values: Any) -> Any:
    return mi.Float64(aligned(np.atleast_1d(np.asarray(values, dtype=np.float64))))


def row(value: Any) -> np.ndarray:
    return np.array(value).T[0]


def heading(angle: float, lift: float = 0.3) -> np.ndarray:
    """A unit direction."""
    return np.array((np.cos(angle), np.sin(angle), lift)) / np.hypot(1.0, lift)


def column(point: np.ndarray) -> tuple[float, np.ndarray]:
    """Index and its gradient in a column of hot air along z."""
    x, y, _ = point
    fall = DEPTH * np.exp(-(x * x + y * y) / WIDTH_MM**2)
    return AMBIENT - fall, 2.0 * fall / WIDTH_MM**2 * np.array((x, y, 0.0))


def column_change(point: np.ndarray, direction: np.ndarray) -> np.ndarray:
    """Change of its gradient along a direction."""
    x, y, _ = point
    fall = DEPTH * np.exp(-(x * x + y * y) / WIDTH_MM**2)
    across = np.array((x, y, 0.0))
    flat = direction * (1.0, 1.0, 0.0)
    turned: np.ndarray = flat - 2.0 / WIDTH_MM**2 * across * (across @ direction)
    return 2.0 * fall / WIDTH_MM**2 * turned


def between(
    start: np.ndarray, direction: np.ndarray, length: float
) -> tuple[np.ndarray, np.ndarray]:
    """Deflection and lateral offset on a straight way through the column."""
    ends = [in_column(start + way * direction, direction) for way in (0.0, length)]
    deflection, offset = between_shells(*ends, vectors(direction), numbers(length))
    return row(deflection), row(offset)


def in_column(place: np.ndarray, direction: np.ndarray) -> AtShell:
    """The air at a shell in the column."""
    index, gradient = column(place)
    return AtShell(vectors(gradient), vectors(column_change(place, direction)), numbers(index))


def exactly(
    start: np.ndarray, direction: np.ndarray, length: float
) -> tuple[np.ndarray, np.ndarray]:
    """The same by quadrature (Gauss and Legendre, 40 points)."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    way = 0.5 * length * (nodes + 1.0)
    index, gradient = zip(*(column(start + s * direction) for s in way), strict=True)
    pull = np.array(gradient) / np.array(index)[:, None]
    pull -= np.outer(pull @ direction, direction)
    weighted = 0.5 * length * weights[:, None] * pull
    return weighted.sum(axis=0), ((length - way)[:, None] * weighted).sum(axis=0)


@given(along=angles, towards=angles, length=st.floats(0.1, 30.0))
def test_a_uniform_gradient_bends_rays_exactly(along: float, towards: float, length: float) -> None:
    """The deflection is the gradient across the ray times the way, the offset half that by it."""
    direction, gradient = heading(along), 1e-5 * heading(towards, -0.2)
    index = AMBIENT - 1e-4
    step = length * float(direction @ gradient)
    ends = [
        AtShell(vectors(gradient), vectors(UNIFORM), numbers(index + sign * step / 2))
        for sign in (-1, 1)
    ]
    expected = (gradient - direction * (direction @ gradient)) * length / index
    size = 1e-5 * length
    for found in (
        between_shells(*ends, vectors(direction), numbers(length)),
        beside_part(ends[0]._replace(index=numbers(index)), vectors(direction), numbers(length)),
    ):
        np.testing.assert_allclose(row(found[0]), expected, rtol=0, atol=1e-9 * size)
        np.testing.assert_allclose(
            row(found[1]), expected * length / 2, rtol=0, atol=1e-9 * size * length
        )


@given(cosine=st.floats(-1.0, 1.0))
def test_length_gain_is_the_best_linear_estimate(cosine: float) -> None:
    """Against the covariance with the one measured component over that component's variance."""
    axis, across = np.array((1.0, 0.0)), np.array((0.0, 1.0))
    ray = cosine * axis + np.sqrt(1 - cosine**2) * across
    covariance = np.outer(axis, axis) + DIRECTION_ERROR**2 * np.outer(across, across)
    expected = axis @ covariance @ ray / (ray @ covariance @ ray)
    assert np.array(length_gain(numbers(cosine)))[0] == pytest.approx(expected, rel=1e-12)


def test_the_indexs_step_corrects_a_gradient_of_wrong_length() -> None:
    """10 % too short a gradient along the ray's plane bends almost as the right one does."""
    direction, gradient, length = heading(0.4), 1e-5 * heading(0.0, 0.0), 3.0
    step = length * float(direction @ gradient)
    ends = [
        AtShell(vectors(0.9 * gradient), vectors(UNIFORM), numbers(AMBIENT + sign * step / 2))
        for sign in (-1, 1)
    ]
    found = row(between_shells(*ends, vectors(direction), numbers(length))[0])
    right = (gradient - direction * (direction @ gradient)) * length / AMBIENT
    assert np.linalg.norm(found - right) < 0.03 * np.linalg.norm(right)


@given(
    x=st.floats(-20.0, 20.0),
    y=st.floats(5.0, 20.0),
    along=angles,
    length=st.floats(0.5, 3.0),
)
def test_short_ways_through_a_column_are_right(
    x: float, y: float, along: float, length: float
) -> None:
    """Turn and end within 1 % of the gradient times the way, or that times the lever.

    No nearer to the axis than the way is long, where the gradient turns round.
    """
    start, direction = np.array((x, y, 0.0)), heading(along)
    turn, aside = between(start, direction, length)
    true_turn, true_aside = exactly(start, direction, length)
    size = length * max(np.linalg.norm(column(start + s * direction)[1]) for s in (0.0, length))
    assert np.linalg.norm(turn - true_turn) < 0.01 * size
    assert np.linalg.norm(aside - true_aside) < 0.01 * size * length


def test_errors_fall_with_the_fifth_power_of_the_way() -> None:
    """As those of Hermite's rule; so it is of fourth order for a whole ray."""
    places = np.random.default_rng(3).uniform((-20, 3, 0), (20, 20, 6.28), size=(60, 3))
    errors = []
    for length in (4.0, 2.0, 1.0):
        off = []
        for x, y, along in places:
            direction = heading(along)
            start = np.array((x, y, 0.0)) - 0.5 * length * direction
            off.append(between(start, direction, length)[0] - exactly(start, direction, length)[0])
        errors.append(np.median(np.linalg.norm(off, axis=1)))
    assert errors[0] / errors[1] > 24.0
    assert errors[1] / errors[2] > 24.0


@given(x=st.floats(-20.0, 20.0), y=st.floats(2.0, 20.0), along=angles, length=st.floats(0.5, 20.0))
def test_a_way_turns_a_ray_that_is_sent_back_as_much(
    x: float, y: float, along: float, length: float
) -> None:
    """The same turn, and both ends aside of each other's straight way by the whole lever."""
    start, direction = np.array((x, y, 0.0)), heading(along)
    turn, aside = between(start, direction, length)
    back, aside_back = between(start + length * direction, -direction, length)
    size = np.linalg.norm(turn) + 1e-12
    np.testing.assert_allclose(back, turn, rtol=0, atol=1e-6 * size)
    np.testing.assert_allclose(aside + aside_back, turn * length, rtol=0, atol=1e-6 * size * length)


@given(angle=st.floats(0.1, 1.4), length=st.floats(0.0, 1e3))
def test_ambient_air_outside_the_first_shell_fades(angle: float, length: float) -> None:
    """A long way gains the step of the index over the cosine; a short one the gradient times it."""
    magnitude, contrast = 2e-6, 1e-5
    direction = np.array((np.cos(angle), np.sin(angle), 0.0))
    # As it rises exponentially to the ambient's.
    change = (-(magnitude**2) / contrast * np.cos(angle), 0.0, 0.0)
    shell = AtShell(vectors((magnitude, 0.0, 0.0)), vectors(change), numbers(AMBIENT - contrast))
    found = outside(shell, numbers(contrast), vectors(direction), numbers(length))
    fading = contrast / (magnitude * np.cos(angle))
    expected = magnitude * np.sin(angle) * min(length, fading) / (AMBIENT - contrast)
    lever = min(length / 2, fading)
    deflection, moment = (np.linalg.norm(row(value)) for value in found)
    assert deflection == pytest.approx(expected, rel=1e-9, abs=1e-20)
    assert moment == pytest.approx(expected * lever, rel=1e-9, abs=1e-20)


@given(x=st.floats(-20.0, 20.0), y=st.floats(5.0, 20.0), along=angles)
def test_the_way_to_the_part_is_right_to_second_order(x: float, y: float, along: float) -> None:
    """Taylor's series of the gradient: a way half as long leaves an eighth of the error."""
    start, direction = np.array((x, y, 0.0)), heading(along)
    off = []
    for length in (0.4, 0.2):
        found = beside_part(in_column(start, direction), vectors(direction), numbers(length))
        truth = exactly(start, direction, length)
        size = 4 * DEPTH * (length / WIDTH_MM) ** 3
        assert np.linalg.norm(row(found[0]) - truth[0]) < size
        moment = truth[0] * length - truth[1]
        assert np.linalg.norm(row(found[1]) - moment) < size * length
        off.append(np.linalg.norm(row(found[0]) - truth[0]) / size)
    assert off[1] == pytest.approx(off[0], abs=0.1)


def test_ways_that_leave_a_layer_began_outside_the_data() -> None:
    """A layer that ends 5 mm away; a gradient that turns over within 20 mm."""
    contrast, gradient = 1e-5, np.array((4e-6, 0.0, 0.0))
    along, across = vectors((1.0, 0.0, 0.0)), vectors((0.0, 1.0, 0.0))
    level = numbers(AMBIENT)
    uniform = AtShell(vectors(gradient), vectors(UNIFORM), level)
    turning = AtShell(vectors(gradient), vectors((0.0, 4e-7, 0.0)), level)
    for shell, way, length, inside in (
        (uniform, along, 4.9, True),
        (uniform, along, 5.1, False),
        (uniform, across, 500.0, True),
        (turning, across, 9.0, True),
        (turning, across, 21.0, False),
    ):
        found = stays_in_layer(shell, numbers(contrast), way, numbers(length))
        assert np.array(found)[0] == inside


def test_shells_without_a_step_bend_nothing() -> None:
    shell = AtShell(vectors(UNIFORM), vectors(UNIFORM), numbers(AMBIENT))
    way = vectors((0.6, 0.8, 0.0)), numbers(5.0)
    for found in (
        between_shells(shell, shell, *way),
        beside_part(shell, *way),
        outside(shell, numbers(0.0), *way),
    ):
        np.testing.assert_array_equal(np.array(found), 0)


@given(angle=angles, tilt=angles)
def test_a_point_is_brought_back_onto_a_plane(angle: float, tilt: float) -> None:
    direction, facet, aside = heading(angle), heading(tilt, 0.1), np.array((1e-4, -2e-4, 3e-4))
    assume(abs(direction @ facet) > 0.01)
    along = np.array(onto_plane(vectors(aside), vectors(direction), vectors(facet)))[0]
    assert (aside + along * direction) @ facet == pytest.approx(0.0, abs=1e-15)


@given(bulge=st.floats(5.0, 50.0), angle=st.floats(0.0, 1.5))
def test_air_around_a_tube_fades_sooner_the_more_it_curves(bulge: float, angle: float) -> None:
    """Against quadrature of n that fades exponentially with the distance from a tube."""
    half_step, fading = 1e-5, 1.5
    direction = np.array((np.cos(angle), np.sin(angle), 0.0))
    s = np.linspace(0.0, 60.0, 20_001)
    x, y = bulge + s * direction[0], s * direction[1]
    distance = np.hypot(x, y)
    fall = half_step * np.exp(-(distance - bulge) / fading) / fading / distance
    pull = np.stack((fall * x, fall * y, 0 * s), axis=1)
    pull -= np.outer(pull @ direction, direction)
    true = np.trapezoid(pull, s, axis=0)
    steep = half_step / fading
    outwards = np.array((1.0, 0.0, 0.0))
    around = np.array((0.0, 1.0, 0.0))
    change = -steep / fading * outwards * direction[0] + steep / bulge * around * direction[1]
    shell = AtShell(vectors(steep * outwards), vectors(change), numbers(AMBIENT - half_step))
    turn, _ = outside(shell, numbers(half_step), vectors(direction), numbers(60.0))
    size = steep * min(fading / max(np.cos(angle), 1e-9), np.sqrt(fading * bulge))
    assert np.linalg.norm(row(turn) - true) < 0.2 * size

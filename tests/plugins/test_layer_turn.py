"""Turns of rays between shells against media whose gradient is known everywhere."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from iriftrace.plugins.kernels.layers import Layer, onto_plane, outside, slope_of

pytestmark = pytest.mark.usefixtures("variant")

AMBIENT = 1.00027
WIDTH_MM = 15.0
DEPTH = 1.5e-4
STILL = (0.0, 0.0, 0.0)

angles = st.floats(0.0, 2.0 * np.pi)


def vectors(rows: Any) -> Any:
    """Vector3d from (n, 3) or (3,) numbers."""
    import mitsuba as mi

    return mi.Vector3d(*np.atleast_2d(np.asarray(rows, dtype=np.float64)).T)


def numbers(values: Any) -> Any:
    import mitsuba as mi

    return mi.Float64(np.atleast_1d(np.asarray(values, dtype=np.float64)))


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
    """What `Layer` says of a straight way through the column: the turn, and how far aside."""
    places = (start, start + length * direction)
    slopes = [
        slope_of(vectors(column(place)[1]), vectors(column_change(place, direction)))
        for place in places
    ]
    levels = [numbers(column(place)[0]) for place in places]
    layer = Layer(*slopes, *levels, numbers(AMBIENT - DEPTH), numbers(AMBIENT))
    turn, aside, _ = layer.through(vectors(direction), numbers(length))
    return row(turn), row(aside)


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
def test_a_uniform_gradient_turns_rays_exactly(along: float, towards: float, length: float) -> None:
    """The turn is the gradient across the ray times the way; its end lies half of that aside."""
    direction, gradient = heading(along), 1e-5 * heading(towards, -0.2)
    index = AMBIENT - 1e-4
    step = length * float(direction @ gradient)
    slope = slope_of(vectors(gradient), vectors(STILL))
    levels = numbers(index - step / 2), numbers(index + step / 2)
    layer = Layer(slope, slope, *levels, numbers(index), numbers(AMBIENT))
    turn, aside, rise = layer.through(vectors(direction), numbers(length))
    expected = (gradient - direction * (direction @ gradient)) * length / index
    size = 1e-5 * length
    np.testing.assert_allclose(row(turn), expected, rtol=0, atol=1e-9 * size)
    np.testing.assert_allclose(row(aside), expected * length / 2, rtol=0, atol=1e-9 * size * length)
    assert np.array(rise)[0] == pytest.approx(0.0, abs=1e-15)


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
    random = np.random.default_rng(3)
    errors = []
    for length in (4.0, 2.0, 1.0):
        off = []
        for x, y, along in random.uniform((-20, 3, 0), (20, 20, 6.28), size=(200, 3)):
            start, direction = np.array((x, y, 0.0)), heading(along)
            middle = start - 0.5 * length * direction
            found, true = (
                between(middle, direction, length)[0],
                exactly(middle, direction, length)[0],
            )
            off.append(np.linalg.norm(found - true))
        errors.append(np.median(off))
        random = np.random.default_rng(3)
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
    steep, half_step = 2e-6, 1e-5
    direction = np.array((np.cos(angle), np.sin(angle), 0.0))
    # As it rises exponentially to the ambient's.
    change = (-(steep**2) / half_step * np.cos(angle), 0.0, 0.0)
    slope = slope_of(vectors((steep, 0.0, 0.0)), vectors(change))
    level = numbers(AMBIENT - half_step)
    ambient = numbers(AMBIENT)
    turn, arm = outside(slope, level, ambient, ambient, vectors(direction), numbers(length), 1)
    fading = half_step / (steep * np.cos(angle))
    expected = steep * np.sin(angle) * min(length, fading) / (AMBIENT - half_step)
    assert np.linalg.norm(row(turn)) == pytest.approx(expected, rel=1e-9, abs=1e-20)
    assert np.linalg.norm(row(arm)) == pytest.approx(
        expected * min(length / 2, fading), rel=1e-9, abs=1e-20
    )


def test_air_that_rises_linearly_to_the_ambient_ends_at_once() -> None:
    """So its mean distance is half of what it is where it fades, for rays along the gradient."""
    steep, half_step, angle = 2e-6, 1e-5, 0.1
    direction = np.array((np.cos(angle), np.sin(angle), 0.0))
    slope = slope_of(vectors((steep, 0.0, 0.0)), vectors(STILL))
    level, ambient = numbers(AMBIENT - half_step), numbers(AMBIENT)
    turn, arm = outside(slope, level, ambient, ambient, vectors(direction), numbers(100.0), 1)
    mean = np.linalg.norm(row(arm)) / np.linalg.norm(row(turn))
    assert mean == pytest.approx(half_step / (steep * np.cos(angle)) / 2, rel=0.01)


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("angle", [0.2, -0.2])
def test_gradients_that_turn_outside_turn_rays(sense: int, angle: float) -> None:
    """Against quadrature of plane air whose gradient leans the more, the further out it is."""
    half_step, fading, lean = 1e-5, 1.5, 0.05
    out = np.array((np.cos(angle), np.sin(angle), 0.0))
    s = np.linspace(0.0, 40.0, 100_001)
    x = s * out[0]
    fall = half_step / fading * np.exp(-x / fading)
    pull = np.stack((fall, fall * lean * x / fading, 0 * s), axis=1)
    pull *= half_step / np.trapezoid(pull @ out, s)
    pull -= np.outer(pull @ out, out)
    true = np.trapezoid(pull, s, axis=0)
    far = np.trapezoid(pull * s[:, None], s, axis=0)
    steep = half_step / fading
    derivatives = steep / fading * np.array(((-1.0, lean, 0.0), (lean, 0.0, 0.0), (0.0, 0.0, 0.0)))
    direction = sense * out
    ambient = numbers(AMBIENT)
    slope = slope_of(vectors((steep, 0.0, 0.0)), vectors(derivatives @ direction))
    level, way = ambient - half_step, numbers(40.0)
    turn, arm = outside(slope, level, ambient, ambient, vectors(direction), way, sense)
    index = AMBIENT - half_step
    np.testing.assert_allclose(row(turn) * index, true, atol=0.03 * np.linalg.norm(true))
    np.testing.assert_allclose(row(arm) * index, far, atol=0.06 * np.linalg.norm(far))
    plain = np.sin(angle) / np.cos(angle) * half_step
    assert abs(np.linalg.norm(true) / abs(plain) - 1) > 0.1


def test_shells_without_a_step_turn_nothing() -> None:
    slope = slope_of(vectors(STILL), vectors(STILL))
    level, length = numbers(AMBIENT), numbers(5.0)
    layer = Layer(slope, slope, level, level, level, level)
    turn, aside = layer.turn(vectors((0.6, 0.8, 0.0)), length, False)
    np.testing.assert_array_equal(np.array(turn), 0)
    np.testing.assert_array_equal(np.array(aside), 0)


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
    s = np.linspace(0.0, 60.0, 200_001)
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
    ambient = numbers(AMBIENT)
    turn, _ = outside(
        slope_of(vectors(steep * outwards), vectors(change)),
        ambient - half_step,
        ambient,
        ambient,
        vectors(direction),
        numbers(60.0),
        1,
    )
    size = steep * min(fading / max(np.cos(angle), 1e-9), np.sqrt(fading * bulge))
    assert np.linalg.norm(row(turn) - true) < 0.2 * size

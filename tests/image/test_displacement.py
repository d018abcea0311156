"""The displacement splits at the line of sight, with the right signs, for both projections."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import Status
from iriftrace.image.displacement import (
    displacement_map,
    good_mask,
    shift_map,
    signed_components,
    split_displacement,
)
from validation.inputs.cameras import camera_at
from validation.oracles.aov_by_hand import make_image, plate

PINHOLE = camera_at((0, -100, 0), sensor_mm=(6, 4), resolution=(12, 8))
PARALLEL = Camera(
    sensor_mm=(6, 4),
    resolution=(12, 8),
    matrix=look_at((0, -100, 0), (0, 0, 0)),
    projection="orthographic",
)
WALL = plate((15, 0, 0), (0, 0, 40), (0, 0, 0))
# Narrower than the parallel camera's picture, so that some pixels see nothing.
STRIP = plate((2, 0, 0), (0, 0, 40), (0, 0, 0))


def test_axial_is_positive_away_from_the_camera() -> None:
    """The parallel camera looks along +y: y is axial, x and z are lateral."""
    image = make_image(PARALLEL, WALL, displacement=(0.003, 0.002, 0.004))
    result = displacement_map(image)
    assert result.good.any()
    np.testing.assert_allclose(result.axial[result.good], 0.002, rtol=1e-6)
    np.testing.assert_allclose(result.lateral[result.good], 0.005, rtol=1e-6)
    np.testing.assert_allclose(result.norm[result.good], np.sqrt(29) * 1e-3, rtol=1e-6)


def test_pinhole_splits_along_each_pixels_own_line_of_sight() -> None:
    """A displacement of 1 um along y seen under the angle a: cos(a) along, sin(a) across."""
    image = make_image(PINHOLE, WALL, displacement=(0, 0.001, 0))
    result = displacement_map(image)
    _, directions = PINHOLE.rays()
    cosine = directions[:, 1].reshape(8, 12)[result.good]
    np.testing.assert_allclose(result.axial[result.good], 1e-3 * cosine, rtol=1e-6)
    sine = np.sqrt(1 - cosine**2)
    np.testing.assert_allclose(result.lateral[result.good], 1e-3 * sine, rtol=1e-5, atol=1e-12)


@given(
    vector=st.tuples(*[st.floats(-1, 1)] * 3),
    towards=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3),
)
def test_parts_obey_pythagoras(
    vector: tuple[float, float, float], towards: tuple[float, float, float]
) -> None:
    sight = np.array([towards]) / np.linalg.norm(towards)
    lateral, axial = split_displacement(np.array([vector]), sight)
    assert lateral[0] ** 2 + axial[0] ** 2 == pytest.approx(np.dot(vector, vector), abs=1e-14)
    opposite = split_displacement(np.array([vector]), -sight)
    assert opposite[1][0] == pytest.approx(-axial[0])


def test_maps_are_zero_where_rays_do_not_count() -> None:
    status = np.zeros((8, 12))
    status[:4] = Status.OUT_OF_FOCUS
    status[4, :] = Status.INDEX_MISMATCH
    image = make_image(PARALLEL, STRIP, displacement=(1, 0, 0), shift=(0.5, -0.25), status=status)
    result, shift = displacement_map(image), shift_map(image)
    missed = image.status == Status.MISSED
    assert missed.any()
    np.testing.assert_array_equal(result.good, (image.status == 0))
    np.testing.assert_array_equal(result.good, shift.good)
    for values in (result.norm, result.lateral, result.axial, shift.pixels):
        assert not values[~result.good].any()
    np.testing.assert_array_equal(
        shift.pixels[shift.good], np.tile([0.5, -0.25], (shift.good.sum(), 1))
    )
    more = displacement_map(image, include=(0, 5))
    assert more.good.sum() == result.good.sum() + (image.status == 5).sum()


@pytest.mark.parametrize("include", [(), (0, 1), (3,), (99,)])
def test_rays_without_two_hits_cannot_be_included(include: tuple[int, ...]) -> None:
    with pytest.raises(InputError, match="only 0 and 5"):
        good_mask(make_image(PARALLEL, WALL), include)


def test_signed_components_are_an_orthonormal_split_of_a_camera_that_is_turned() -> None:
    """Their squares sum up to the length's; right and down raise column and row of the picture."""
    camera = camera_at(
        (120.0, -90.0, 80.0), (0.0, 5.0, -3.0), sensor_mm=(6.0, 4.0), resolution=(60, 40)
    )
    rng = np.random.default_rng(2)
    hits = rng.uniform(-10.0, 10.0, (50, 3))
    vectors = 1e-4 * rng.normal(size=(50, 3))
    sight = (hits - camera.origin) / np.linalg.norm(hits - camera.origin, axis=1)[:, None]
    found = signed_components(vectors, sight, camera.matrix[:3, 0])
    total = sum(value**2 for value in found.values())
    np.testing.assert_allclose(total, np.sum(vectors**2, axis=1), rtol=1e-12)
    lateral, axial = split_displacement(vectors, sight)
    np.testing.assert_allclose(found["along"], axial, rtol=1e-12, atol=1e-20)
    np.testing.assert_allclose(np.hypot(found["right"], found["down"]), lateral, rtol=1e-9)
    only = signed_components(np.tile(camera.matrix[:3, 1], (50, 1)), sight, camera.matrix[:3, 0])
    assert (only["down"] > 0.9).all()

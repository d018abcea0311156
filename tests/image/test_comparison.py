"""Measured against simulated shifts: where they are compared, and what the numbers say."""

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from attrs import evolve
from scipy.spatial.transform import Rotation

from iriftrace.camera.camera import Camera
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.files import FileOrigin
from iriftrace.figures.comparison import comparison_figure
from iriftrace.image.aov_image import AovImage
from iriftrace.io.measured_shift import MeasuredShift
from iriftrace.measuring.comparison import compare, correlation
from validation.inputs.lenses import LENSES, lens_camera
from validation.oracles.aov_by_hand import make_image, make_part

OFFSET = np.array((0.6, -0.4))
SLOPE = np.array(((2e-2, -1e-2), (5e-3, -3e-2)))
"""A shift that is linear in the hot position, which interpolation between pixels keeps exactly."""


def shift_at(hot: np.ndarray) -> np.ndarray:
    return OFFSET + hot @ SLOPE.T


def box_image(camera: Camera) -> AovImage:
    mesh = trimesh.creation.box((60, 50, 40))
    width, height = camera.resolution
    columns, rows = np.meshgrid(np.arange(width), np.arange(height))
    return make_image(
        camera,
        make_part(mesh.vertices, mesh.faces),
        shift=shift_at(np.stack((columns, rows), axis=2)),
    )


@pytest.fixture(scope="module")
def image() -> AovImage:
    return box_image(lens_camera(None).scaled(0.05))


def measured(
    places: np.ndarray, shifts: np.ndarray, resolution: tuple[int, int] | None = None
) -> MeasuredShift:
    return MeasuredShift(places, shifts, resolution, FileOrigin("by hand", "0" * 64))


def places_on_part(image: AovImage, count: int) -> np.ndarray:
    """Well inside the part, so that it is seen when hot too."""
    good = image.status == 0
    inside = good.copy()
    for axis in (0, 1):
        for step in range(-4, 5):
            inside &= np.roll(good, step, axis=axis)
    row, column = np.nonzero(inside)
    rng = np.random.default_rng(1)
    chosen = rng.choice(len(row), count, replace=False)
    return np.stack((column, row), axis=1)[chosen] + rng.uniform(0, 1, (count, 2))


def test_cold_places_are_looked_up_where_they_are_seen_when_hot(image: AovImage) -> None:
    """u_hot = u_cold + shift(u_hot) has a closed form for a linear shift.

    Two steps of the fixed point leave the slope's third power of the shift, 3e-5 px here, where
    shifts are a hundred times those of air; the shift at the cold place is off by 0.05 px.
    """
    cold = places_on_part(image, 200)
    hot = np.linalg.solve(np.eye(2) - SLOPE, (cold + OFFSET).T).T
    exact = shift_at(hot)
    found = compare(image, measured(cold, exact))
    assert len(found.places) == 200
    np.testing.assert_allclose(found.simulated, exact, rtol=0, atol=2e-4)
    assert np.abs(shift_at(cold) - exact).max() > 0.02
    there = compare(image, measured(hot, exact), positions="hot")
    # float32 channels
    np.testing.assert_allclose(there.simulated, exact, rtol=0, atol=5e-7)


def test_every_pixel_of_a_map_counts_once(image: AovImage) -> None:
    """At hot pixel centres nothing is interpolated, so that pixels at the part's edge count too."""
    good = image.status == 0
    row, column = np.nonzero(np.ones_like(good))
    centres = np.stack((column, row), axis=1)
    found = compare(image, measured(centres, shift_at(centres), image.resolution), positions="hot")
    assert len(found.places) == good.sum()
    assert len(found.measurement.places) - len(found.places) == good.size - good.sum()
    assert np.abs(found.residual).max() < 1e-6
    np.testing.assert_allclose(found.points, image.vector("refracted", good), atol=1e-12)


@pytest.mark.parametrize("lens", [None, LENSES["pincushion"]], ids=["pinhole", "pincushion"])
@pytest.mark.parametrize("noise", [0.005, 0.05])
def test_known_motion_and_noise_come_back(lens: Any, noise: float) -> None:
    """A rigid motion, exact by projecting the hits from both poses, and noise of known deviation.

    Each of the six numbers within four of its deviations; the residual is the noise.
    """
    camera = lens_camera(lens).scaled(0.05)
    image = box_image(camera)
    good = image.status == 0
    row, column = np.nonzero(good)
    centres = np.stack((column, row), axis=1)
    hits = image.vector("refracted", good)
    motion = np.array((0.03, -0.05, 0.08, 4e-4, -3e-4, 6e-4))
    step = np.eye(4)
    step[:3, :3] = Rotation.from_rotvec(motion[3:]).as_matrix()
    step[:3, 3] = motion[:3]
    rigid = camera.at(camera.matrix @ step).project(hits) - camera.project(hits)
    rng = np.random.default_rng(3)
    shifts = shift_at(centres) + rigid + rng.normal(0, noise, rigid.shape)
    found = compare(image, measured(centres, shifts, image.resolution), positions="hot")
    assert found.motion is not None
    got = np.concatenate((found.motion.translation_mm, found.motion.rotation_rad))
    # The second order of the motion counts a thousandth of it.
    allowed = 4 * found.motion.deviations + 2e-3 * np.abs(motion)
    assert (np.abs(got - motion) < allowed).all()
    assert found.motion.rms_after_px == pytest.approx(np.sqrt(2) * noise, rel=0.05)
    assert found.motion.rms_before_px > 3 * found.motion.rms_after_px or noise == 0.05
    np.testing.assert_allclose(found.remainder.mean(axis=0), 0, atol=0.2 * noise)


def test_numbers_of_a_known_residual(image: AovImage, tmp_path: Path) -> None:
    """A measurement that is off by (0.3, -0.4) px everywhere."""
    row, column = np.nonzero(image.status == 0)
    centres = np.stack((column, row), axis=1)
    shifts = measured(centres, shift_at(centres) + np.array((0.3, -0.4)), image.resolution)
    found = compare(image, shifts, positions="hot")
    report = found.as_dict()
    assert report["residual_px"]["bias"] == pytest.approx([0.3, -0.4], abs=1e-6)
    for key in ("rms", "median", "p95", "max"):
        assert report["residual_px"][key] == pytest.approx(0.5, abs=1e-6)
    assert report["correlation"] == pytest.approx(1, abs=1e-9)
    sizes = np.linalg.norm(shift_at(centres), axis=1)
    assert report["simulated_px"]["median"] == pytest.approx(np.median(sizes), rel=1e-6)
    assert report["points"] == {
        "measured": len(row),
        "failed": 0,
        "zeros": 0,
        "compared": len(row),
        "without_simulation": 0,
    }
    assert report["measured"]["kind"] == "map"
    assert report["camera_motion"]["explained"] > 0.99
    assert report["camera"] == image.header["camera"]
    found.save(tmp_path / "a.json")
    assert json.loads((tmp_path / "a.json").read_text()) == report


@pytest.mark.parametrize(
    ("signs", "named"), [((1, -1), "dv"), ((-1, 1), "du"), ((-1, -1), "du and dv")]
)
def test_another_sign_is_told(image: AovImage, signs: tuple[int, int], named: str) -> None:
    """A picture whose v axis points up, although a motion of the camera shifts all of it by 2 px.

    No number is changed.
    """
    places = places_on_part(image, 100)
    exact = shift_at(places)
    found = measured(places, np.array(signs) * (exact - exact.mean(axis=0)) + 2.0)
    with pytest.warns(IriftraceWarning, match=f"With the other sign of {named}, the shifts of by"):
        compared = compare(image, found, positions="hot")
    np.testing.assert_array_equal(compared.measured, found.shifts)


def test_noise_has_no_sign(image: AovImage) -> None:
    """No warning where no choice fits: shifts of noise, and half of the true ones."""
    places = places_on_part(image, 100)
    noise = np.random.default_rng(3).normal(0.0, 1.0, (100, 2))
    compare(image, measured(places, noise), positions="hot")
    compare(image, measured(places, 0.5 * shift_at(places)), positions="hot")


def test_opposite_shifts_have_correlation_minus_one(image: AovImage) -> None:
    """The sign convention the other way round shows at once."""
    places = places_on_part(image, 100)
    with pytest.warns(IriftraceWarning, match="other sign of du and dv"):
        found = compare(image, measured(places, -shift_at(places)), positions="hot")
    assert correlation(found.measured, found.simulated) == pytest.approx(-1, abs=1e-9)
    assert correlation(np.ones((5, 2)), np.arange(10.0).reshape(5, 2)) is None


def test_motion_that_cannot_be_told_is_no_error() -> None:
    """Markers on one line: bias and residual stand, the motion is not known."""
    image = box_image(lens_camera(None).scaled(0.05))
    row = 51
    column = np.flatnonzero(image.status[row] == 0)[:4]
    places = np.column_stack((column, np.full(4, row)))
    for name in "XYZ":
        image.channels[f"refracted.{name}"][row, column] = (
            np.arange(4) * (0.5, 0.2, 0.1)["XYZ".index(name)]
        )
    found = compare(image, measured(places, shift_at(places)), positions="hot")
    assert found.motion is None
    report = found.as_dict()
    assert "do not determine the motion" in report["camera_motion"]["reason"]
    np.testing.assert_array_equal(found.remainder, found.residual)


@pytest.mark.parametrize(
    ("resolution", "places", "message"),
    [
        ((60, 50), [(1, 1)] * 9, "60 x 50 pixels, but the rendering has 122 x 102"),
        (None, [(9, 9)] * 8 + [(9, 103)], r"1 of 9 places .* the first at \(9, 103\)"),
        (None, [(0, 0)] * 9, "Only 0 of 9 measured places"),
    ],
)
def test_measurements_of_another_picture_are_refused(
    image: AovImage, resolution: Any, places: Any, message: str
) -> None:
    wrong = measured(np.array(places, dtype=float), np.zeros((9, 2)), resolution)
    with pytest.raises(InputError, match=message):
        compare(image, wrong)


def test_markers_on_a_scaled_rendering_give_a_warning(image: AovImage) -> None:
    """Positions in the camera's own pixels may all lie inside a smaller picture by chance."""
    places = places_on_part(image, 50)
    shifts = shift_at(places)
    scaled = evolve(image, header={**image.header, "full_resolution": [488, 408]})
    with pytest.warns(IriftraceWarning, match=r"122 x 102 px, 0\.25 times the camera's 488 across"):
        compare(scaled, measured(places, shifts))
    whole = evolve(image, header={**image.header, "full_resolution": [122, 102]})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        compare(whole, measured(places, shifts))
        # A map of the same size says that it belongs to this picture.
        compare(scaled, measured(places, shifts, image.resolution))


@pytest.mark.parametrize("as_map", [True, False])
def test_figure_shows_what_it_says(image: AovImage, as_map: bool) -> None:
    """Four columns of two components; one scale for shifts, another one for residuals."""
    row, column = np.nonzero(image.status == 0)
    centres = np.stack((column, row), axis=1)
    rng = np.random.default_rng(5)
    shifts = measured(centres, shift_at(centres) + rng.normal(0.1, 0.02, centres.shape))
    found = compare(image, shifts, positions="hot")
    resolution = image.resolution if as_map else None
    figure = comparison_figure(found, resolution, "second line")
    panels = [axes for axes in figure.axes if axes.get_ylabel() != "" or axes.get_title() != ""]
    titles = [axes.get_title() for axes in panels if axes.get_title()]
    assert titles == ["Measured", "Simulated", "Residual", "Residual without camera motion"]
    drawn = [(axes.images or axes.collections)[0] for axes in figure.axes[:8]]
    limits = [artist.get_clim() for artist in drawn]
    assert limits[0] == limits[1] == limits[4] == limits[5]
    assert limits[2] == limits[3] == limits[6] == limits[7]
    assert limits[0][1] > 2 * limits[2][1]
    values = np.ma.compressed(np.ma.masked_invalid(drawn[6].get_array()))
    np.testing.assert_allclose(np.sort(values), np.sort(found.residual[:, 1]))
    assert "without the camera's motion" in figure.get_suptitle()
    assert "compared" in figure.legends[0].get_texts()[0].get_text()

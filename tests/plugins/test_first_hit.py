"""The integrator first_hit as a Mitsuba user meets it: channels, film, determinism."""

from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError
from iriftrace.image.aov_image import CHANNELS
from iriftrace.plugins.calibrated_camera import sensor_of
from iriftrace.plugins.kernels.projection import flip_axes
from iriftrace.plugins.kernels.vertex_table import aligned
from validation.inputs.cameras import camera_at
from validation.inputs.small_scenes import (
    camera,
    channels,
    film,
    nested_spheres,
    part,
    scene,
    sphere,
    vector,
)

pytestmark = pytest.mark.usefixtures("variant")


@pytest.fixture
def lens(tmp_path: Path) -> dict[str, Any]:
    """A ball of 8 mm inside a ball of glass: hits move by millimetres and pixels."""
    return {
        "part": part(tmp_path, sphere(8.0)),
        **nested_spheres(tmp_path, (20.0,), (1.0, 1.05), subdivisions=4),
    }


def test_render_gives_the_channels_and_the_film_keeps_their_names(shapes: dict[str, Any]) -> None:
    """Bit for bit what image() gives; the film's own channel Y comes first and is empty."""
    loaded = scene(shapes)
    image = channels(loaded)
    rendered = np.array(mi.render(loaded))
    assert rendered.shape == (40, 48, 1 + len(CHANNELS))
    bitmap = loaded.sensors()[0].film().bitmap()
    assert [field.name for field in bitmap.struct_()] == ["Y", *CHANNELS]
    for pixels in (rendered, np.array(bitmap)):
        np.testing.assert_array_equal(pixels[..., 0], 0)
        for k, name in enumerate(CHANNELS):
            np.testing.assert_array_equal(pixels[..., k + 1], image[name])
    assert loaded.integrator().aov_names() == list(CHANNELS)


def test_every_channel_is_finite_and_zero_where_it_does_not_exist(shapes: dict[str, Any]) -> None:
    pixels = channels(scene(shapes))
    missed = pixels["status.code"] == 1
    assert 0.5 < missed.mean() < 0.95
    for name, values in pixels.items():
        assert values.dtype == np.float32
        assert np.isfinite(values).all()
        if name != "status.code":
            np.testing.assert_array_equal(values[missed], 0)
    np.testing.assert_array_equal(pixels["status.code"][~missed], 0)
    np.testing.assert_array_equal(pixels["path.crossings"][~missed], 3)


def test_hits_lie_where_the_closed_form_has_them(shapes: dict[str, Any]) -> None:
    """Straight hits on the faces' planes in NumPy, for the face that the channel names; incidence,
    displacement and path length follow from the hits."""
    mesh = sphere(10.0)
    pixels = channels(scene(shapes))
    described = camera_at()
    origins, directions = (v.reshape(40, 48, 3) for v in described.rays())
    hit = pixels["part.face"] > 0
    face = pixels["part.face"][hit].astype(int) - 1
    corners = np.asarray(mesh.vertices, dtype=np.float32).astype(np.float64)[mesh.faces[face]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    o, d = origins[hit], directions[hit]
    cosine = (d * normal).sum(axis=1)
    length = ((corners[:, 0] - o) * normal).sum(axis=1) / cosine
    # float32 channels: 1e-6 mm at 10 mm
    np.testing.assert_allclose(vector(pixels, "straight")[hit], o + length[:, None] * d, atol=1e-6)
    np.testing.assert_allclose(pixels["incidence.angle"][hit], np.arccos(-cosine), atol=1e-6)
    difference = vector(pixels, "refracted") - vector(pixels, "straight")
    moved = vector(pixels, "displacement")
    np.testing.assert_allclose(moved, difference, atol=2e-6)
    np.testing.assert_allclose(
        pixels["displacement.norm"], np.linalg.norm(moved, axis=-1), rtol=1e-5, atol=1e-12
    )
    # The bent path is longer than the straight line to its end, by the square of 1e-4 rad.
    chord = np.linalg.norm(vector(pixels, "refracted")[hit] - o, axis=1)
    assert (np.abs(pixels["path.length"][hit] - chord) < 2e-5).all()


def test_shift_is_the_pixels_centre_less_the_projection_of_the_refracted_hit(
    lens: dict[str, Any],
) -> None:
    """By the NumPy camera; the ball is a lens, so the part appears larger: shifts point outward."""
    pixels = channels(scene(lens))
    described = camera_at()
    good = pixels["status.code"] == 0
    centres = np.stack(np.meshgrid(np.arange(48), np.arange(40)), axis=-1)[good]
    expected = centres - described.project(vector(pixels, "refracted")[good])
    found = np.stack((pixels["shift.px.X"], pixels["shift.px.Y"]), axis=-1)[good]
    assert np.abs(expected).max() > 0.1
    # The refracted channel is rounded to 5e-7 mm, a pixel sees 1.2 mm.
    np.testing.assert_allclose(found, expected, atol=2e-6)
    outward = (found * (centres - (23.5, 19.5))).sum(axis=1)
    assert (outward > 0).all()


def test_normals_parameter_chooses_gradient_or_facets(shapes: dict[str, Any]) -> None:
    """Facets of a coarse sphere bend differently; without vertex normals both are the same."""
    gradient, facet = (channels(scene(shapes, normals=n)) for n in ("gradient", "facet"))
    difference = gradient["displacement.norm"] - facet["displacement.norm"]
    assert np.abs(difference).max() > 1e-6
    # The index's derivatives are missing in these shells' files, so this is the only possibility.
    for values in ({}, {"bending": "layers"}, {"bending": "shells"}):
        same = channels(scene(shapes, **values))
        np.testing.assert_array_equal(same["displacement.norm"], gradient["displacement.norm"])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"normals": "gradien"}, "\"normals\" is 'gradien'.*one of gradient, facet"),
        ({"normals": 3}, '"normals" is 3'),
        ({"bending": "layer"}, "\"bending\" is 'layer'.*one of layers, shells"),
        ({"bending": True}, '"bending" is True'),
        ({"inside_hit": "keep"}, "\"inside_hit\" is 'keep'.*one of refract, drop"),
        ({"max_crossings": 0}, '"max_crossings" is 0.*at least 1'),
        ({"max_crossings": 2.5}, '"max_crossings" is 2.5.*whole'),
        ({"max_crossings": 2**40}, '"max_crossings" is 1.09951e'),
        ({"max_crossings": "7"}, "\"max_crossings\" is '7', not a number"),
        ({"trace_all": "true"}, "\"trace_all\" is 'true', not a truth value"),
        ({"trace_al": True}, "unreferenced property"),
    ],
)
def test_wrong_parameters_are_refused(values: dict[str, Any], message: str) -> None:
    with pytest.raises(RuntimeError, match=message):
        mi.load_dict({"type": "first_hit", **values})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"component_format": "float16"}, "component_format float32"),
        ({"rfilter": {"type": "gaussian"}}, '<rfilter type="box"/>'),
    ],
)
def test_films_that_smear_or_round_are_refused(
    shapes: dict[str, Any], changes: dict[str, Any], message: str
) -> None:
    loaded = scene(shapes, camera(film=film(**changes)))
    with pytest.raises(InputError, match=message):
        channels(loaded)


def test_crop_window_is_a_piece_of_the_whole_picture(shapes: dict[str, Any]) -> None:
    whole = channels(scene(shapes))
    window = film(crop_offset_x=15, crop_offset_y=10, crop_width=12, crop_height=20)
    loaded = scene(shapes, camera(film=window))
    piece = channels(loaded)
    rendered = np.array(mi.render(loaded))
    for k, name in enumerate(CHANNELS):
        np.testing.assert_array_equal(piece[name], whole[name][10:30, 15:27])
        np.testing.assert_array_equal(rendered[..., k + 1], piece[name])


def test_report_counts_and_describes(shapes: dict[str, Any]) -> None:
    loaded = scene(shapes)
    _, report = loaded.integrator().image(loaded, loaded.sensors()[0])
    assert report["counts"]["open_boundary"] == 0
    # All shells are in view: three icospheres of 1280 triangles; only half would be without sides.
    assert report["counts"]["triangles_in_view"] == 3 * 1280
    assert Camera.from_dict(report["camera"]).resolution == (48, 40)
    assert set(report["time_s"]) == {"straight", "refracted", "channels"}
    away = sensor_of(camera_at((0.0, -100.0, 0.0), (0.0, -200.0, 0.0)))
    assert loaded.integrator().image(loaded, away)[1]["counts"]["triangles_in_view"] == 0


def test_second_pose_compiles_no_kernel(shapes: dict[str, Any], kernel_history: Any) -> None:
    """Neither through the scene's parameters nor with a new sensor: poses are data, not code.

    A kernel that comes from Dr.Jit's cache on disk counts as compiled: the first run of this test
    on a machine would have compiled it.
    """
    loaded = scene(shapes)
    integrator = loaded.integrator()

    def look(sensor: Any) -> None:
        assert integrator.surroundings(loaded, sensor) is None
        integrator.image(loaded, sensor)

    look(loaded.sensors()[0])
    look(sensor_of(camera_at((3.0, -90.0, 5.0))))
    first = kernel_history()
    assert len(first) >= 20
    parameters = mi.traverse(loaded)
    parameters["sensor.to_world"] = mi.Transform4d(flip_axes(look_at((40, 80, 33), (1, 0, 0))))
    parameters.update()
    look(loaded.sensors()[0])
    # Nothing hit, and back; another focus interval.
    integrator.image(loaded, sensor_of(camera_at((0.0, -90.0, 0.0), (0.0, -99.0, 0.0))))
    for x in range(5):
        look(sensor_of(camera_at((-70.0, 5.0 * x, 60.0), focus_mm=(10.0 + x, 500.0))))
    launched = kernel_history()
    # Seven poses of some nine: one writes all channels, and not one each.
    assert 40 <= len(launched) <= 80
    assert not [k for k in launched if not k["cache_hit"] or k["cache_disk"]]


def test_kernels_do_not_depend_on_where_numpy_puts_its_arrays(
    shapes: dict[str, Any], kernel_history: Any
) -> None:
    """Dr.Jit writes into a kernel whether its input's address is a multiple of 128 bytes."""
    loaded = scene(shapes)
    prepared = loaded.integrator().prepare(loaded)
    outward = sphere(1.0, 2).vertices

    def layers(keep: int) -> None:
        # Odd lengths between them, so that the addresses differ.
        points = [np.zeros(keep + 13 * k) for k in range(40)]
        np.testing.assert_allclose(prepared.layers_near(outward * 14, outward)[0], 1.00021)
        assert len(points) == 40

    layers(3)
    kernel_history()
    for keep in range(8):
        layers(keep)
    launched = kernel_history()
    assert launched
    assert all(k["cache_hit"] and not k["cache_disk"] for k in launched)


def test_result_depends_neither_on_the_run_nor_on_the_threads(shapes: dict[str, Any]) -> None:
    first = channels(scene(shapes))
    threads = dr.thread_count()
    try:
        dr.set_thread_count(1)
        single = channels(scene(shapes))
        dr.set_thread_count(5)
        several = channels(scene(shapes))
    finally:
        dr.set_thread_count(threads)
    again = channels(scene(shapes))
    for other in (single, several, again):
        for name in CHANNELS:
            np.testing.assert_array_equal(other[name], first[name])


def test_integrator_prepares_anew_for_another_scene(tmp_path: Path) -> None:
    """One integrator, two scenes in turn: tables of the first must not serve the second."""
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    small, large = (
        scene({"part": part(tmp_path / name, sphere(radius))})
        for name, radius in (("a", 5.0), ("b", 15.0))
    )
    integrator = small.integrator()
    status = CHANNELS.index("status.code")
    counts = [
        int((np.array(integrator.image(s, s.sensors()[0])[0])[status] == 0).sum())
        for s in (small, large, small)
    ]
    assert counts[0] == counts[2] < counts[1] / 5


@pytest.mark.parametrize(
    ("origin", "where"),
    [((0.0, -100.0, 0.0), None), ((0.0, -18.0, 0.0), "hot air"), ((1.0, 2.0, 3.0), "part")],
)
def test_surroundings_of_a_sensor(
    shapes: dict[str, Any], origin: tuple[float, float, float], where: str | None
) -> None:
    loaded = scene(shapes)
    sensor = sensor_of(camera_at().at(look_at(origin, (0.0, 50.0, 0.0))))
    assert loaded.integrator().surroundings(loaded, sensor) == where


def with_attributes(loaded: Any, attributes: dict[str, int], shells: tuple[str, ...]) -> Any:
    """The scene whose shells got further vertex attributes, zeros of so many values."""
    for shape in loaded.shapes():
        if shape.id() in shells:
            for name, size in attributes.items():
                values = np.zeros(size * shape.vertex_count(), dtype=np.float32)
                shape.add_attribute(name, size, mi.Float(aligned(values)))
    return loaded


DERIVATIVES = {
    "vertex_gradient": 3,
    **{f"vertex_hessian_{axes}": 1 for axes in ("xx", "yy", "zz", "yz", "xz", "xy")},
}


@pytest.mark.parametrize(
    "attributes",
    [
        {"vertex_gradient": 3},
        {f"vertex_gradient_{k}": 1 for k in (1, 2, 3)},
        {**DERIVATIVES, "vertex_gradient": 1},
        {name.upper().replace("VERTEX", "vertex"): size for name, size in DERIVATIVES.items()},
    ],
)
def test_derivatives_by_halves_or_other_names_are_refused(
    shapes: dict[str, Any], attributes: dict[str, int]
) -> None:
    """Ignored in silence, rays would be bent at the shells alone."""
    loaded = scene(shapes)
    ids = tuple(shape.id() for shape in loaded.shapes() if shape.id() != "part")
    with pytest.raises(InputError, match=r"vertex_gradient \(3\), vertex_hessian_xx \(1\)"):
        channels(with_attributes(loaded, attributes, ids))


def test_the_bending_in_force_is_said(shapes: dict[str, Any]) -> None:
    """One shell without derivatives keeps all from bending rays in the layers."""
    loaded = scene(shapes)
    ids = tuple(shape.id() for shape in loaded.shapes() if shape.id() != "part")
    assert "bending=layers" in str(loaded.integrator())
    for given, said in ((ids[:1], "shells"), (ids, "layers")):
        loaded = with_attributes(scene(shapes), DERIVATIVES, given)
        channels(loaded)
        assert f"bending={said}" in str(loaded.integrator())

"""Figures of a pose and a scene: plotted values against the channels, labels against VTK's view."""

import os
import subprocess
import sys
from io import BytesIO
from itertools import chain
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
import pyvista as pv
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.image import imread

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError, SetupError
from iriftrace.figures import space
from iriftrace.figures.pose import displacement_figure
from iriftrace.figures.result import plot, read_result
from iriftrace.figures.scene import scene_figure
from iriftrace.figures.scene_picture import temperature_scale
from iriftrace.figures.space import View, box_around, fitting_view, view_direction
from iriftrace.figures.style import write_figure
from iriftrace.figures.sweep import sweep_pictures
from iriftrace.figures.sweep_picture import pose_maps
from iriftrace.image.aov_image import CHANNELS, SCHEMA, AovImage, Status
from iriftrace.io.exr import write_exr
from iriftrace.io.part_files import read_part
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.levels import index_levels
from iriftrace.medium.shells.stack import Shell, ShellStack
from iriftrace.part.part import Part
from iriftrace.planning.summary import summarise
from validation.inputs.sweep_tables import known_sweep

WIDTH, HEIGHT = 60, 40
# What the synthetic picture shows: (rows, columns) of the part, and of a step in depth on it.
PART = np.s_[8:32, 10:50]
STEP_COLUMN = 30


def synthetic_image(seed: int = 1, scale_mm: float = 0.003) -> AovImage:
    """A wall at 100 mm whose right part stands 20 mm behind the left; lognormal displacements."""
    camera = Camera(
        focal_length_mm=10,
        sensor_mm=(6.0, 4.0),
        resolution=(WIDTH, HEIGHT),
        focus_mm=(50, 250),
    )
    shape = (HEIGHT, WIDTH)
    channels = {name: np.zeros(shape, np.float32) for name in CHANNELS}
    status = np.full(shape, Status.MISSED)
    status[PART] = Status.GOOD
    status[8:12, 10:20] = Status.OUT_OF_FOCUS
    status[20, 20] = Status.INDEX_MISMATCH
    seen = status != Status.MISSED
    depth = np.where(np.arange(WIDTH) < STEP_COLUMN, 100.0, 120.0)
    _, directions = camera.rays()
    rays = directions.reshape(HEIGHT, WIDTH, 3)
    hits = rays * (depth[None, :] / rays[..., 2])[..., None]
    for axis, name in enumerate("XYZ"):
        channels[f"straight.{name}"][seen] = hits[..., axis][seen]
    channels["part.face"][seen] = np.broadcast_to(1 + (depth > 110), shape)[seen]
    channels["incidence.angle"][seen] = np.arccos(rays[..., 2])[seen]
    norm = scale_mm * np.random.default_rng(seed).lognormal(0.0, 1.0, shape)
    channels["displacement.norm"][status == Status.GOOD] = norm[status == Status.GOOD]
    channels["status.code"][:] = status
    header = {
        "camera": camera.as_dict(),
        "wavelength_nm": 633.0,
        "normals": "gradient",
        "engine": "shells",
        "field": {"path": "somewhere/plume.vtu"},
    }
    return AovImage(channels, header)


def good_um(image: AovImage) -> np.ndarray:
    """Displacements of the good rays, um, straight from the channels."""
    return image.channels["displacement.norm"][image.status == 0].astype(np.float64) * 1000.0


def marked_edges(image: AovImage) -> set[tuple[float, ...]]:
    """Pixel edges drawn as silhouettes: (column, row, column, row)."""
    drawn = displacement_figure(image).axes[0].collections
    segments = (lines.get_segments() for lines in drawn if isinstance(lines, LineCollection))
    return {tuple(segment.ravel().tolist()) for segment in chain.from_iterable(segments)}


def test_plotted_array_is_the_displacement_in_micrometres() -> None:
    """Millimetres times 1000 where a ray is good, masked everywhere else."""
    image = synthetic_image()
    plotted = displacement_figure(image).axes[0].images[-1].get_array()
    assert isinstance(plotted, np.ma.MaskedArray)
    np.testing.assert_array_equal(~np.ma.getmaskarray(plotted), image.status == 0)
    np.testing.assert_allclose(plotted.compressed(), good_um(image), rtol=1e-12)


def test_the_lines_below_the_title_keep_their_distance() -> None:
    figure = displacement_figure(synthetic_image(), view="Pose 10, azimuth 90, elevation 37")
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    title, lines = (
        text.get_window_extent(canvas.get_renderer())
        for text in (figure._suptitle, figure.axes[0].title)
    )
    assert (title.y0 - lines.y1) * 72 / figure.dpi > 9, "points, as much as the letters are high"


@pytest.mark.parametrize(
    ("component", "axis", "words"),
    [
        ("along", (0.0, 0.0, 1.0), "along the line of sight"),
        ("right", (1.0, 0.0, 0.0), "across the line of sight"),
        ("down", (0.0, 1.0, 0.0), "across the line of sight"),
    ],
)
def test_signed_components_diverge_from_0(
    component: Literal["along", "right", "down"], axis: tuple[float, float, float], words: str
) -> None:
    """A parallel camera, whose axes are the components': x right, y down, z away from it."""
    image = synthetic_image()
    values = image.header["camera"] | {"projection": "orthographic", "focal_length_mm": None}
    moved = np.random.default_rng(3).normal(size=(HEIGHT, WIDTH, 3)) * (1e-3, 2e-3, 3e-3)
    moved[image.status != 0] = 0.0
    for k, name in enumerate("XYZ"):
        image.channels[f"displacement.{name}"][:] = moved[..., k]
    image = AovImage(image.channels, image.header | {"camera": values})
    figure = displacement_figure(image, component=component)
    picture = figure.axes[0].images[-1]
    low, high = picture.get_clim()
    assert low == -high < 0.0
    assert picture.norm(0.0) == 0.5
    expected = 1e3 * (moved[image.status == 0] @ axis)
    assert (expected < 0.0).any()
    np.testing.assert_allclose(picture.get_array().compressed(), expected, rtol=1e-6)
    assert high == pytest.approx(np.percentile(np.abs(expected), 99), rel=1e-6)
    assert words in figure.get_suptitle()
    assert list(plot(image, component=component, name="a").figures) == [f"a_{component}"]


def test_included_status_is_plotted_too() -> None:
    """`include` counts as it does for the metrics, so that both describe the same rays."""
    image = synthetic_image()
    image.channels["displacement.norm"][20, 20] = 0.007
    image.channels["path.length"][20, 20] = 100.0
    plotted = displacement_figure(image, (0, 5)).axes[0].images[-1].get_array()
    assert plotted[20, 20] == pytest.approx(7.0)


def test_pictures_of_a_sweep_show_the_rays_that_it_includes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    image = synthetic_image()
    image.channels["displacement.norm"][20, 20] = 0.007
    image.channels["path.length"][20, 20] = 100.0
    for module in ("sweep", "sweep_picture"):
        of_best = f"iriftrace.figures.{module}.extreme_images"
        monkeypatch.setattr(of_best, lambda *_: iter([("best", image)]))
    monkeypatch.setattr("iriftrace.core.runtime.doctor.drawing_trouble", lambda: "no display")
    for include in ([0], [0, 5]):
        table = known_sweep(include=include)
        summary = summarise(table)
        figures, _ = sweep_pictures(table, summary)
        plotted = figures["view_best"].axes[0].images[-1].get_array()
        assert plotted.mask[20, 20] == (5 not in include)
        maps, _ = pose_maps(table, summary)
        colour = imread(BytesIO(maps[summary.plan.best]))[20, 20, :3]
        assert (colour == 1.0).all() == (5 not in include)


@pytest.mark.parametrize("value_mm", [0.0, 0.004])
def test_equal_displacements_can_be_drawn(value_mm: float, tmp_path: Path) -> None:
    """Shells without an index step move nothing: no scale may fail or warn then."""
    image = synthetic_image()
    image.channels["displacement.norm"][image.status == 0] = value_mm
    write_figure(displacement_figure(image), tmp_path / "equal.png")
    low, high = displacement_figure(image).axes[0].images[-1].get_clim()
    assert low < high
    assert low <= 1000 * value_mm <= high


def test_rays_without_displacement_are_drawn() -> None:
    """Zero has no logarithm, but rays that cross no shell are good: they get the lowest colour."""
    image = synthetic_image()
    image.channels["displacement.norm"][25, 40] = 0.0
    picture = displacement_figure(image).axes[0].images[-1]
    colours = picture.to_rgba(picture.get_array())
    np.testing.assert_array_equal(colours[..., 3] > 0, image.status == 0)
    np.testing.assert_allclose(colours[25, 40], picture.cmap(0.0))


def test_silhouettes_are_the_outline_and_the_step_in_depth() -> None:
    """The outline of 24 x 40 pixels is 128 edges long; the step adds 24 and nothing else."""
    drawn = marked_edges(synthetic_image())
    step = {(float(STEP_COLUMN), float(row), float(STEP_COLUMN), row + 1.0) for row in range(8, 32)}
    assert step <= drawn
    assert len(drawn) == 2 * (24 + 40) + 24


def test_faces_without_a_step_in_depth_leave_no_line() -> None:
    """Edges between faces are not silhouettes: else every triangle of the mesh would be drawn."""
    image = synthetic_image()
    hits = image.vector("straight")
    flat = hits / np.where(hits[..., 2:] > 0, hits[..., 2:], 1.0) * 100.0
    for axis, name in enumerate("XYZ"):
        image.channels[f"straight.{name}"][:] = flat[..., axis]
    assert len(marked_edges(image)) == 2 * (24 + 40)


def test_a_result_and_its_file_give_the_same_figure(tmp_path: Path) -> None:
    """`plot` names the figure of a file after the file; float32 channels come back bit for bit."""
    image = synthetic_image()
    image.header["schema"] = SCHEMA
    write_exr(tmp_path / "pose.exr", image)
    (drawn,) = plot(image).figures.values()
    plots = plot(read_result(tmp_path / "pose.exr"))
    assert list(plots.figures) == ["pose"]
    again = plots.figures["pose"].axes[0].images[-1].get_array()
    np.testing.assert_array_equal(again, drawn.axes[0].images[-1].get_array())
    assert plots.save(tmp_path) == [tmp_path / "pose.png"]
    with pytest.raises(InputError, match="neither"):
        read_result(tmp_path / "pose.png")


def test_no_good_ray_is_an_error_and_leaves_no_file(tmp_path: Path) -> None:
    """An empty picture would look like a result."""
    image = synthetic_image()
    image.channels["status.code"][image.status == 0] = Status.OUT_OF_FOCUS
    with pytest.raises(InputError, match="no good ray"):
        write_figure(displacement_figure(image), tmp_path / "none.png")
    assert list(tmp_path.iterdir()) == []


def a_camera(**values: object) -> Camera:
    """A camera at (120, -90, 80) mm that looks at the origin."""
    settings = {
        "focal_length_mm": 10,
        "sensor_mm": (6.7, 5.6),
        "resolution": (1224, 1024),
        "focus_mm": (50, 200),
        "matrix": look_at((120, -90, 80), (0, 0, 0)),
        **values,
    }
    return Camera(**settings)


@pytest.fixture(scope="module")
def cube(tmp_path_factory: pytest.TempPathFactory) -> Part:
    """A cube of 20 mm about the origin."""
    path = tmp_path_factory.mktemp("part") / "cube.ply"
    pv.Cube(x_length=20, y_length=20, z_length=20).triangulate().clean().save(path)
    return read_part(path)


def spheres(layers: int) -> ShellStack:
    """Concentric spheres of 20 to 40 mm between ambient and air of 1000 K."""
    air = Air()
    hottest = float(air.refractivity(1000.0))
    surfaces, e = index_levels(air.ambient_refractivity, hottest, layers, "midpoint")
    shells = []
    for number, radius in enumerate(np.linspace(40, 20, layers)):
        mesh = pv.Icosphere(radius=radius, nsub=3)
        shells.append(
            Shell(
                layer=number + 1,
                refractivity=float(surfaces[number]),
                ext=float(e[number]),
                int_=float(e[number + 1]),
                vertices=mesh.points,
                faces=mesh.regular_faces,
                normals=mesh.points / radius,
            )
        )
    return ShellStack(tuple(shells), air, "midpoint")


def test_scene_picture_has_its_size_and_all_that_is_asked_for(cube: Part, tmp_path: Path) -> None:
    """1600 x 1200 pixels; names, units, temperatures in degC; the part's orange is to be seen."""
    path = tmp_path / "scene.png"
    figure = scene_figure(cube, spheres(5), a_camera())
    write_figure(figure, path)
    assert imread(path).shape[:2] == (1200, 1600)
    assert [file.name for file in tmp_path.iterdir()] == [path.name]

    scene, bar = figure.axes
    texts = [text.get_text() for text in scene.texts]
    assert {"x (mm)", "y (mm)", "z (mm)", "Camera", "Near focus 50 mm", "Far focus 200 mm"} <= set(
        texts
    )
    assert "°C" in bar.get_ylabel()
    assert any("5 shells" in text.get_text() for text in figure.texts)
    picture = np.asarray(scene.images[0].get_array())
    # Pixel for pixel: else lines and labels of the picture would be resampled.
    np.testing.assert_allclose(picture.shape[1::-1], scene.bbox.size, atol=1e-6)
    red, green, blue = np.moveaxis(picture[..., :3].astype(int), -1, 0)
    assert ((red - green > 25) & (green - blue > 25)).mean() > 0.01


def test_orthographic_and_vertical_views_can_be_drawn(cube: Part) -> None:
    """A parallel camera has no focal length, and one that looks down has no horizontal axis."""
    camera = a_camera(
        projection="orthographic",
        focal_length_mm=np.nan,
        sensor_mm=(60, 50),
        matrix=look_at((0, 0, 150), (0, 0, 0)),
    )
    scene_figure(cube, spheres(1), camera)


def test_colours_are_linear_in_refractivity() -> None:
    """Equal index steps get equal colour steps, from 0 at the coolest to 1 at the hottest shell."""
    shells = spheres(9)
    scale = temperature_scale([shells])
    np.testing.assert_allclose(scale.norm(scale.values), np.linspace(0, 1, 9), atol=1e-9)
    ticks = scale.ticks
    assert len(ticks) >= 4
    assert min(ticks) >= scale.values.min()
    assert max(ticks) <= scale.values.max()


def test_labels_meet_what_vtk_draws(cube: Part) -> None:
    """A small ball appears where View.pixels says: else the labels would lie beside their lines."""
    box = box_around(np.array([(-50.0, -40.0, -30.0), (90.0, 20.0, 60.0)]))
    towards, _ = view_direction(np.array((-0.8, 0.5, -0.4)), np.array((0.0, 0.0, 1.0)))
    view = fitting_view(towards, box, (400, 300))
    place = np.array((70.0, -20.0, 40.0))
    plotter = pv.Plotter(off_screen=True, window_size=[400, 300], theme=pv.themes.DocumentTheme())
    plotter.add_mesh(pv.Sphere(radius=3, center=place), color="black", lighting=False)
    view.apply_to(plotter, box)
    picture = plotter.screenshot(return_img=True)
    plotter.close()
    row, column = np.nonzero(picture[..., 0] < 128)
    found = (column.mean() + 0.5, 300 - (row.mean() + 0.5))
    np.testing.assert_allclose(found, view.pixels(place)[0], atol=0.5)


def test_view_holds_the_box_and_leaves_room_for_labels() -> None:
    """All corners lie inside the picture, and the box fills it across or upwards."""
    box = box_around(np.array([(0.0, 0.0, 0.0), (100.0, 60.0, 80.0)]))
    towards, side = view_direction(np.array((0.0, 1.0, 0.0)), np.array((0.0, 0.0, 1.0)))
    view = fitting_view(towards, box, (1390, 1080))
    corners = view.pixels(box.corners)
    assert np.all(corners > 15)
    assert np.all(corners < np.array((1390, 1080)) - 15)
    assert abs(np.linalg.norm(towards) - 1.0) < 1e-12
    # Across the axis, and on the viewer's side.
    assert abs(side @ (0.0, 1.0, 0.0)) < 1e-12
    assert side @ towards > 0.5


@pytest.mark.parametrize("azimuth_deg", range(0, 360, 30))
def test_camera_stands_at_the_right(azimuth_deg: int) -> None:
    """Wherever the camera is, it looks to the left in the picture, so that pictures compare."""
    a = np.radians(azimuth_deg)
    forward = np.array((np.cos(a), np.sin(a), -0.5)) / np.sqrt(1.25)
    towards, _ = view_direction(forward, np.array((0.0, 0.0, 1.0)))
    view = View(towards, np.zeros(3), 1.0, (0, 0))
    assert view.pixels(forward)[0, 0] < -0.5


def test_no_opengl_is_a_setup_error(
    cube: Part, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """VTK would end the process; the user gets one sentence with the remedy instead."""
    monkeypatch.setattr(space, "opens", lambda window: False)
    with pytest.raises(SetupError, match="libegl1"):
        write_figure(scene_figure(cube, spheres(2), a_camera()), tmp_path / "scene.png")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_window_that_cannot_open_is_noticed_before_vtk_crashes() -> None:
    """VTK's last resort, OSMesa, is absent on most machines: drawing with it would be a crash."""
    script = (
        "import pyvista as pv\n"
        "from iriftrace.figures import space\n"
        "with pv.vtk_verbosity('off'):\n"
        "    plotter = pv.Plotter(off_screen=True)\n"
        "    print(space.opens(plotter.render_window))\n"
    )
    environment = {**os.environ, "VTK_DEFAULT_OPENGL_WINDOW": "vtkOSOpenGLRenderWindow"}
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() in ("True", "False")

"""Pages that a browser turns: no request, each control changes the picture, values are the array's.

The picture of the short test has one plane of each kind: its values are known in closed form.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from attrs import evolve
from browser import Shown, browser
from playwright.sync_api import Browser

from iriftrace.camera.pose import look_at
from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.figures.page import frame, policy, write_page
from iriftrace.figures.picture import DrawnBody, Lines, Poses, SpacePicture, round_factor
from iriftrace.figures.pictures import picture_of
from iriftrace.figures.style import ColourScale
from iriftrace.io.exr import read_exr
from iriftrace.scenes import folder_of

MOST_BYTES = 4_000_000


@pytest.fixture(scope="module")
def opened() -> Iterator[Browser]:
    with browser() as program:
        yield program


def number(text: str) -> float:
    """The number in a line such as "height: 1.5 µm, u 0.1 µm"."""
    return float(text.partition(": ")[2].split()[0].replace("\N{MINUS SIGN}", "-").rstrip(","))


def plane(**more: object) -> DrawnBody:
    """A square of 2 x 32 x 32 triangles in z = 0 with values 3 x + y, um."""
    line = np.linspace(-40.0, 40.0, 33)
    x, y = (each.ravel() for each in np.meshgrid(line, line))
    corner = (np.arange(32)[:, None] * 33 + np.arange(32)).ravel()
    one = np.stack((corner, corner + 1, corner + 34), axis=1)
    other = np.stack((corner, corner + 34, corner + 33), axis=1)
    values = 3.0 * x + y
    scale = ColourScale(values, (-100.0, 100.0), "height (µm)", False)
    vertices = np.stack((x, y, 0.0 * x), axis=1)
    faces = np.concatenate((one, other))
    return evolve(DrawnBody("plane", vertices, faces, scale=scale, values=values), **more)


def seen_from_above(*surfaces: DrawnBody) -> SpacePicture:
    return SpacePicture("A plane", surfaces=surfaces, towards=np.array((0.0, 0.01, 1.0)))


def shown(opened: Browser, picture: SpacePicture, folder: Path) -> Shown:
    file = folder / "view.html"
    write_page(file, picture)
    return Shown(opened, file)


def test_values_under_the_pointer_are_those_of_the_array(opened: Browser, tmp_path: Path) -> None:
    """Of a face, interpolated between its corners, with u; to four digits, and 16 bits of place."""
    surface = plane(u=np.full(33 * 33, 0.25))
    page = shown(opened, seen_from_above(surface), tmp_path)
    for place in ((0.4, 0.4), (0.5, 0.63), (0.47, 0.5)):
        index, (_, value, at) = page.under(*place)
        x, y, _ = (float(v) for v in at[4:-4].replace("\N{MINUS SIGN}", "-").split(", "))
        assert 0 <= index < len(surface.faces)
        assert number(value) == pytest.approx(3.0 * x + y, abs=0.02)
        assert value.endswith("u 0.25 µm")
    assert page.under(0.02, 0.5) == (-1, [])
    assert page.wrong == []


def test_points_and_faces_show_their_own_value(opened: Browser, tmp_path: Path) -> None:
    """Of a cloud that of its point, to the digits printed; of a map over faces that of its face."""
    rng = np.random.default_rng(5)
    cloud = plane(faces=np.empty((0, 3), dtype=int), values=rng.normal(size=33 * 33))
    by_face = rng.normal(size=2 * 32 * 32)
    for surface, values in ((cloud, cloud.values), (plane(values=by_face), by_face)):
        page = shown(opened, seen_from_above(surface), tmp_path)
        found = [page.under(*place) for place in ((0.4, 0.4), (0.5, 0.6), (0.45, 0.5))]
        assert len({index for index, _ in found}) == 3
        for index, (_, value, _) in found:
            assert number(value) == float(f"{np.float32(np.asarray(values)[index]):.4g}")


def test_each_control_changes_the_picture(opened: Browser, tmp_path: Path) -> None:
    """Shells, their opacity, the cut, exaggeration, members, legend, poses, keys and buttons."""
    ball = plane(vertices=1.2 * plane().vertices + (0.0, 0.0, 5.0))
    warm = ColourScale(np.array((20.0, 900.0)), (20.0, 900.0), "air (°C)", False, of_air=True)
    shells = [
        evolve(ball, name=f"shell {n}", scale=warm, values=float(t), opacity=0.4)
        for n, t in enumerate((50.0, 400.0), start=1)
    ]
    moved = np.broadcast_to((0.0, 0.0, 0.01), (33 * 33, 3))
    surface = plane(moved=moved, members={"one": -plane().values, "two": 0.0 * plane().values})
    straight = np.array([(0.0, 0.0, 60.0), (0.0, 0.0, 30.0), (0.0, 0.0, 0.0)])
    bent = straight + np.array([(0.0, 0.0, 0.0), (0.01, 0.0, 0.0), (0.03, 0.0, 0.0)])
    matrices = np.array([look_at((x, 90.0, 60.0), (0.0, 0.0, 0.0)) for x in (-60.0, 60.0)])
    score = ColourScale(np.array((0.2, 0.7)), (0.0, 1.0), "score", False)
    picture = SpacePicture(
        "All of it",
        surfaces=(surface, *shells),
        lines=(Lines("bent rays", [bent], "#b3125f", [straight], 100.0),),
        members=("one", "two"),
        cut=(np.zeros(3), np.array((0.0, 1.0, 0.0))),
        exaggerated="Bending of the rays",
        poses=Poses(matrices, np.zeros((2, 3)), score, ("a", "b"), (("1", "2"), ("3", "4")), 0),
    )
    page = shown(opened, picture, tmp_path)
    assert page.changes("#level", 1)
    assert page.page.inner_text("#level-text").startswith("shell 1: 50 °C")
    assert page.changes("#opacity", 20)
    assert page.changes("#cut", False)
    assert page.changes("#factor", len(picture.factors) - 1)
    assert f"{picture.factors[-1]:.0f} times" in page.page.inner_text("#note")
    assert page.changes("#members", 2)
    assert page.changes("#legend input[value=plane]", False)
    before = page.picture()
    page.page.click("#poses tr[data-pose='1'] button")
    assert page.page.inner_text("#pose-title") == "Pose 1"
    assert page.page.locator("#pose-numbers dd").all_inner_texts() == ["3", "4"]
    turned = page.picture()
    assert turned != before
    page.page.focus("#picture")
    page.page.keyboard.press("ArrowLeft")
    assert page.picture() != turned
    page.page.click("#home")
    assert page.wrong == []


def test_a_bundled_scene_is_one_small_file(opened: Browser, tmp_path: Path) -> None:
    """With its part, shells, camera and bent rays, in a page that names what it shows."""
    file = tmp_path / "view.html"
    assert (
        main(["view", str(folder_of("concentric_cylinders") / "scene.xml"), "-o", str(file)]) == 0
    )
    assert file.stat().st_size < MOST_BYTES
    page = Shown(opened, file)
    assert page.page.locator("#legend input").evaluate_all(
        "all => all.map((one) => one.value)"
    ) == [*("part", "bent rays", "camera")]
    assert "°C" in page.page.inner_text("#bars")
    assert page.page.inner_text("#ruler").endswith("mm")
    assert "bent rays" in str(page.page.get_attribute("#picture", "aria-label"))
    assert page.changes("#level", 1)
    assert page.changes("#factor", 0)
    assert page.wrong == []


def test_a_frame_holds_the_page(opened: Browser, tmp_path: Path) -> None:
    """Of a notebook or report, without rights to the page around it, whose policy it inherits."""
    file = tmp_path / "notebook.html"
    rules = f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; {policy()}"
    meta = f'<meta http-equiv="Content-Security-Policy" content="{rules}">'
    file.write_text(f"<!DOCTYPE html>{meta}<title>x</title>{frame(seen_from_above(plane()))}")
    page = opened.new_page()
    page.goto(file.as_uri())
    page.frame_locator("iframe").locator("html[data-drawn]").wait_for(state="attached")
    page.close()


def test_exaggerations_are_round_and_visible() -> None:
    """The largest offset becomes at most a tenth of the size, and more than a fiftieth of it."""
    for largest in (1e-4, 0.003, 0.0321, 0.4):
        factor = round_factor(largest, 100.0)
        assert factor / 10 ** np.floor(np.log10(factor)) in (1.0, 2.0, 5.0)
        assert 2.0 < factor * largest <= 10.0
    assert round_factor(0.0, 100.0) == 1.0
    assert round_factor(50.0, 100.0) == 1.0


def test_rays_that_bend_by_rounding_alone_have_a_page(tmp_path: Path) -> None:
    """As in air of one temperature; the exaggeration is among those to choose from."""
    line = np.zeros((2, 3)), np.ones((2, 3))
    rays = Lines("rays", line, "#000000", line, round_factor(1e-14, 100.0))
    picture = evolve(seen_from_above(plane()), lines=(rays,), exaggerated="bending")
    assert picture.factor in picture.factors
    write_page(tmp_path / "view.html", picture)


def test_points_without_a_value_are_left_out() -> None:
    cloud = pv.PolyData(np.eye(3))
    cloud.point_data["error_normal"] = np.array((1e-3, np.nan, 3e-3))
    picture = picture_of(cloud)
    assert picture.subtitle.startswith("2 points, median 2 µm")
    np.testing.assert_array_equal(picture.surfaces[-1].vertices, np.eye(3)[[0, 2]])
    cloud.point_data["error_normal"] = np.full(3, np.nan)
    with pytest.raises(InputError) as error:
        picture_of(cloud)
    assert error.value.code == "cloud.no_point"


@pytest.mark.slow
def test_the_tour_of_all_kinds(opened: Browser, tmp_path: Path) -> None:
    """Every kind of file that `iriftrace view` shows: pages of their sizes, controls and values."""
    cylinder, fringe = (
        str(folder_of(name) / "scene.xml") for name in ("cylinder", "fringe_cylinder")
    )
    pose, sweep, scan, corrected = (
        str(tmp_path / name) for name in ("pose.exr", "sweep.nc", "scan.vtp", "corrected.vtp")
    )
    angles = ("--azimuth", "0:90:2", "--elevation", "20:60:2")
    for command in (
        ("render", cylinder, "-o", pose, "--no-figures", "-D", "scale=0.1"),
        ("sweep", cylinder, "-o", sweep, *angles, "--exr", "-D", "scale=0.05"),
        ("measure", fringe, "-o", scan, "--no-figures", "-D", "scale=0.1"),
        ("correct", scan, fringe, "-o", corrected, "--no-figures"),
    ):
        assert main(list(command)) == 0
    pages: dict[str, Shown] = {}
    for file in (
        *(cylinder, pose, sweep, scan, corrected, str(folder_of("cylinder") / "field.vtu")),
        str(folder_of("wishbone") / "part.ply"),
    ):
        page = tmp_path / f"{Path(file).name}.html"
        assert main(["view", file, "-o", str(page)]) == 0
        assert page.stat().st_size < MOST_BYTES
        pages[Path(file).name] = Shown(opened, page)
        assert pages[Path(file).name].wrong == []
    assert pages["scene.xml"].changes("#opacity", 10)
    assert pages["scene.xml"].changes("#cut", False)
    good = read_exr(pose)
    moved = 1e3 * good.channels["displacement.norm"][good.status == 0].astype(np.float64)
    clouds = {
        "pose.exr": moved,
        "scan.vtp": 1e3 * np.asarray(pv.read(scan).point_data["error_normal"]),
        "corrected.vtp": 1e3
        * np.linalg.norm(
            [pv.read(corrected).point_data[f"correction_{axis}"] for axis in "xyz"], axis=0
        ),
    }
    for name, values in clouds.items():
        index, lines = pages[name].under(0.45, 0.5)
        assert number(lines[1]) == float(f"{np.float32(values[index]):.4g}")
        assert pages[name].changes("#factor", 3)
    poses = pages["sweep.nc"].page
    poses.click("#poses tr[data-pose='2'] button")
    assert poses.inner_text("#pose-title") == "Pose 2"
    assert poses.locator("#pose-map").evaluate("image => image.complete && image.naturalWidth > 50")
    assert pages["part.ply"].changes("#legend input >> nth=0", False)

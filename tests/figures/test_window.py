"""The view in space: every kind of file is drawn, and what cannot be shown says why.

The colours looked for are those that the legend of each kind promises.
"""

from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
import pyvista as pv
from matplotlib.colors import LogNorm, to_rgb

from iriftrace.cli import main
from iriftrace.cli.plot import view
from iriftrace.core.errors import InputError, SetupError
from iriftrace.figures import pictures, scene_picture, sweep_picture, window
from iriftrace.figures.picture import PART_COLOUR, SECOND_COLOUR, SIGHT_COLOUR
from iriftrace.figures.result import plot, read_result
from iriftrace.medium.origin import state_origin
from iriftrace.medium.source import FieldFacts, FieldKind, FieldSource
from iriftrace.scenes import folder_of

SCALE = ("-D", "scale=0.05")

HUES = {
    # The part is grey; the middle of the scale.
    "pose.exr": {"#21918c": 0.0005},
    # The best pose of four is the dark end of the scale, as in the maps of `plot`.
    "sweep.nc": {"#440154": 0.0005},
    # Hot air makes the cylinder too small: errors are below 0, and blue; the bar alone is 0.002.
    "scan.vtp": {"#4695c4": 0.004},
    "corrected.ply": {"#21918c": 0.0005},
    # The outer shells are violet air in front of white.
    "cylinder_paper/scene.xml": {PART_COLOUR: 0.003, "#a78bbf": 0.004},
    # Yellow is the wall, blue the air far from it.
    "cylinder/field.vtu": {"#f0f921": 0.003, "#0d0887": 0.05},
    "wishbone/part.ply": {"#1f77b4": 0.01},
}
"""Files of results and of bundled scenes; hues that their pictures show, and the least share."""


def share_like(picture: Path, colour: str) -> float:
    """Share of the pixels that have a colour's hue, as shaded surfaces do."""
    pixels = matplotlib.image.imread(picture)[:, :, :3].reshape(-1, 3)
    wanted = np.array(to_rgb(colour))
    bright = np.linalg.norm(pixels, axis=1)
    cosine = pixels @ wanted / np.maximum(bright, 1e-9) / np.linalg.norm(wanted)
    return float(np.mean((cosine > 0.995) & (np.ptp(pixels, axis=1) > 0.2)))


def share_of(picture: Path, colour: str) -> float:
    """Share of the pixels that have a colour itself, as lines without shading do."""
    pixels = matplotlib.image.imread(picture)[:, :, :3]
    return float(np.mean(np.abs(pixels - to_rgb(colour)).max(axis=2) < 0.01))


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A pose, a sweep and clouds of the bundled cylinder."""
    folder = tmp_path_factory.mktemp("results")
    scene, fringe = (str(folder_of(name) / "scene.xml") for name in ("cylinder", "fringe_cylinder"))
    angles = ("--azimuth", "0:90:2", "--elevation", "20:60:2")
    scan = str(folder / "scan.vtp")
    for command in (
        ("render", scene, "-o", str(folder / "pose.exr"), "--no-figures", *SCALE),
        ("sweep", scene, "-o", str(folder / "sweep.nc"), *angles, *SCALE),
        ("measure", fringe, "-o", scan, "--no-figures", *SCALE),
        ("correct", scan, fringe, "-o", str(folder / "corrected.ply"), "--no-figures"),
    ):
        assert main(list(command)) == 0
    return folder


def drawn(file: Path, folder: Path) -> Path:
    picture = folder / f"{file.name}.png"
    assert main(["view", str(file), "-o", str(picture)]) == 0
    return picture


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if "/" in name else pytest.mark.slow) for name in HUES]
)
def test_files_are_drawn_and_marked(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """The origin of the air decides on a mark; a part has none, and this field states none."""
    marked: list[FieldSource | None] = []
    for module in (pictures, scene_picture, sweep_picture):
        monkeypatch.setattr(module, "synthetic_mark", marked.append)
    folder, _, bundled = name.rpartition("/")
    place = folder_of(folder) if folder else request.getfixturevalue("results")
    picture = drawn(place / bundled, tmp_path)
    for hue, share in HUES[name].items():
        assert share_like(picture, hue) > share
    source = marked[0] if marked else None
    assert len(marked) == (bundled != "part.ply")
    origin = {"part.ply": None, "field.vtu": ""}.get(bundled, "OpenFOAM")
    assert (source and source.origin.partition(",")[0]) == origin
    if bundled == "part.ply":
        # Names of the regions' colours.
        assert share_of(picture, "black") > 0.0003
    if bundled == "scene.xml":
        assert share_of(picture, SIGHT_COLOUR) > 0.0005
        assert share_of(picture, SECOND_COLOUR) == 0.0


def test_a_sweep_states_its_files(results: Path) -> None:
    facts = dict(pictures.picture_of(read_result(results / "sweep.nc")).facts)
    assert {"scene", "part", "field", "engine"} <= facts.keys()
    assert facts["part"].startswith("part.ply, SHA-256 ")


def test_a_pose_has_the_scale_of_its_picture(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawing: list[dict[str, Any]] = []
    monkeypatch.setattr(pv.Plotter, "add_mesh", lambda *_, **look: drawing.append(look))
    drawn(results / "pose.exr", tmp_path)
    (look,) = [look for look in drawing if "clim" in look]
    (figure,) = plot(read_result(results / "pose.exr")).figures.values()
    norm = figure.axes[0].images[-1].norm
    assert isinstance(norm, LogNorm)
    assert look["log_scale"]
    assert look["clim"] == pytest.approx((norm.vmin, norm.vmax), rel=1e-6)


def test_a_scene_shows_both_devices_and_names_its_colours(tmp_path: Path) -> None:
    """In black; those of a part in `test_files_are_drawn_and_marked`."""
    two = drawn(folder_of("fringe_cylinder") / "scene.xml", tmp_path)
    assert share_of(two, SECOND_COLOUR) > 0.0005
    assert share_of(two, "black") > 0.0004


def test_a_field_of_formulas_is_marked(tmp_path: Path) -> None:
    made = tmp_path / "made.vtu"
    grid = pv.read(folder_of("cylinder") / "field.vtu")
    pictures = []
    for kind in (FieldKind.STEADY, FieldKind.SYNTHETIC):
        state_origin(grid, "a program", FieldFacts(kind))
        grid.save(made)
        pictures.append(drawn(made, tmp_path).read_bytes())
    assert pictures[0] != pictures[1]


def test_what_cannot_be_shown_says_why(tmp_path: Path) -> None:
    other = tmp_path / "cloud.vtp"
    pv.PolyData(np.zeros((3, 3))).save(other)
    picture = tmp_path / "view.png"
    with pytest.raises(InputError, match="no column"):
        view(other, output=picture)
    damaged = tmp_path / "cloud.ply"
    damaged.write_bytes((folder_of("cylinder") / "part.ply").read_bytes()[:500])
    with pytest.raises(InputError, match="cannot be read"):
        view(damaged, output=picture)
    with pytest.raises(InputError, match="There is no file"):
        view(tmp_path / "gone.vtp", output=picture)
    (tmp_path / "cloud.asc").write_text("0 0 0")
    with pytest.raises(InputError, match=r"shown from a \.vtp or \.ply"):
        view(tmp_path / "cloud.asc", output=picture)
    text = tmp_path / "notes.md"
    text.write_text("x")
    with pytest.raises(InputError, match="not a field file"):
        view(text, output=picture)
    with pytest.raises(InputError, match="type str cannot be shown"):
        window.view(str(other), picture)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"neither \.png nor \.html"):
        window.view(pv.PolyData(), tmp_path / "view.gif")
    assert not picture.exists()


def test_without_a_display_a_file_is_proposed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(SetupError) as error:
        view(folder_of("cylinder") / "part.ply")
    assert (error.value.code, error.value.argument) == ("window.no_display", "output")

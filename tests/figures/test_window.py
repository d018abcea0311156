"""The view in space: every kind of file is drawn, and what cannot be shown says why.

The colours looked for are those that the legend of each kind promises.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest
import pyvista as pv
from matplotlib.colors import to_rgb

from iriftrace.cli import main
from iriftrace.core.errors import InputError, SetupError
from iriftrace.field.origin import state_origin
from iriftrace.field.source import FieldFacts
from iriftrace.figures import window
from iriftrace.figures.scene import SECOND_COLOUR, SIGHT_COLOUR
from iriftrace.figures.space import PART_COLOUR
from iriftrace.figures.window import view
from iriftrace.scenes import folder_of

SCALE = ("-D", "scale=0.05")

RESULTS = {
    "pose.exr": PART_COLOUR,
    # The best pose of four is the yellow end of the scale.
    "sweep.nc": "#fde725",
    # Hot air makes the cylinder too small: errors are below 0, and red.
    "scan.vtp": "#f09c7b",
    "scan.ply": "#f09c7b",
    "corrected.vtp": "#21918c",
}
"""Files of results, and a colour that the picture of each shows."""


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
    """A pose, a sweep and two clouds of the bundled cylinder."""
    folder = tmp_path_factory.mktemp("results")
    scene, fringe = (str(folder_of(name) / "scene.xml") for name in ("cylinder", "fringe_cylinder"))
    angles = ("--azimuth", "0:90:2", "--elevation", "20:60:2")
    for command in (
        ("render", scene, "-o", str(folder / "pose.exr"), "--no-figures", *SCALE),
        ("sweep", scene, "-o", str(folder / "sweep.nc"), *angles, *SCALE),
        ("measure", fringe, "-o", str(folder / "scan.vtp"), "-D", "scale=0.1"),
        ("measure", fringe, "-o", str(folder / "scan.ply"), "-D", "scale=0.1"),
        ("correct", str(folder / "scan.vtp"), fringe, "-o", str(folder / "corrected.vtp")),
    ):
        assert main(list(command)) == 0
    return folder


def drawn(file: Path, folder: Path) -> Path:
    picture = folder / f"{file.name}.png"
    assert main(["view", str(file), "--picture", str(picture)]) == 0
    return picture


@pytest.fixture(scope="module")
def pictures(
    results: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[dict[str, Path], list[str]]:
    """What is drawn of each result and of a scene, by name, and the origins that were checked."""
    folder = tmp_path_factory.mktemp("pictures")
    said: list[str] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(window, "synthetic_mark", lambda source: said.append(source.origin))
        files = [results / name for name in RESULTS]
        files.append(folder_of("cylinder") / "scene.xml")
        return {file.name: drawn(file, folder) for file in files}, said


def test_a_scene_shows_part_shells_and_both_devices(
    pictures: tuple[dict[str, Path], list[str]], tmp_path: Path
) -> None:
    one = pictures[0]["scene.xml"]
    assert share_like(one, PART_COLOUR) > 0.003
    assert share_of(one, SIGHT_COLOUR) > 0.0005
    assert share_of(one, SECOND_COLOUR) == 0.0
    # The outer shells are violet air in front of white.
    assert share_like(one, "#a78bbf") > 0.005
    two = drawn(folder_of("fringe_cylinder") / "scene.xml", tmp_path)
    assert share_of(two, SECOND_COLOUR) > 0.0005


@pytest.mark.parametrize("name", RESULTS)
def test_results_are_drawn(pictures: tuple[dict[str, Path], list[str]], name: str) -> None:
    assert share_like(pictures[0][name], RESULTS[name]) > 0.0005


def test_a_field_is_cut_open_at_the_part(tmp_path: Path) -> None:
    picture = drawn(folder_of("cylinder") / "field.vtu", tmp_path)
    # Yellow is the wall, blue the air far from it.
    assert share_like(picture, "#f0f921") > 0.003
    assert share_like(picture, "#0d0887") > 0.05


def test_a_part_shows_its_regions(tmp_path: Path) -> None:
    picture = drawn(folder_of("wishbone") / "part.ply", tmp_path)
    assert share_like(picture, "#1f77b4") > 0.01


def test_what_rests_on_no_simulation_says_so(
    pictures: tuple[dict[str, Path], list[str]], tmp_path: Path
) -> None:
    _, said = pictures
    assert len(said) == 6
    assert {origin.partition(",")[0] for origin in said} == {"OpenFOAM"}
    made = tmp_path / "made.vtu"
    grid = pv.read(folder_of("cylinder") / "field.vtu")
    plain = drawn(made_of(grid, "OpenFOAM", made), tmp_path).read_bytes()
    assert drawn(made_of(grid, "synthetic, by hand", made), tmp_path).read_bytes() != plain


def made_of(grid: Any, origin: str, path: Path) -> Path:
    """The grid as a file that states this origin."""
    state_origin(grid, origin, FieldFacts.in_words(origin))
    grid.save(path)
    return path


def test_what_cannot_be_shown_says_why(results: Path, tmp_path: Path) -> None:
    other = tmp_path / "cloud.vtp"
    pv.PolyData(np.zeros((3, 3))).save(other)
    with pytest.raises(InputError, match="no column"):
        view(other, tmp_path / "view.png")
    damaged = tmp_path / "scan.ply"
    damaged.write_bytes((results / "scan.ply").read_bytes()[:500])
    with pytest.raises(InputError, match="damaged"):
        view(damaged, tmp_path / "view.png")
    with pytest.raises(InputError, match="there is no file"):
        view(tmp_path / "gone.vtp", tmp_path / "view.png")
    text = tmp_path / "notes.md"
    text.write_text("x")
    with pytest.raises(InputError, match="not a field file"):
        view(text, tmp_path / "view.png")
    assert not (tmp_path / "view.png").exists()


def test_without_a_display_a_file_is_proposed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(SetupError, match="--picture"):
        view(folder_of("cylinder") / "part.ply")

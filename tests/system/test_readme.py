"""Everything that the README and the pages in docs/ tell the reader to type is typed here."""

import json
import re
import shlex
import shutil
import subprocess
import sys
import textwrap
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from iriftrace.cli.program import app
from iriftrace.cli.project_file import read_project_file
from iriftrace.core.runtime.variant import using
from iriftrace.image.aov_image import CHANNELS
from iriftrace.io.exr import read_exr
from iriftrace.project.steps import steps_of
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.render import render_scene

CHECKOUT = Path(__file__).parents[2]
PAGES = {
    page.name: page.read_text(encoding="utf-8")
    for page in (CHECKOUT / "README.md", *sorted((CHECKOUT / "docs").glob("*.md")))
}
README = PAGES["README.md"]

COMMANDS = {
    "README.md": ["doctor", "demo", "part", "field", "scene", "render", "metrics"],
    "camera_position.md": ["sweep", "plan", "plan", "plan", "plot", "report", "plan"],
    "fields.md": ["field", "field"],
    "project.md": ["demo", "new", "run", "run", "part", "part", "run", "run"],
    "tutorial_scanner.md": ["part", "field", "scene", "measure", "correct"],
}
"""Commands that each page runs; all other pages run nothing."""
WITH_FILES = {"project.md", "tutorial_scanner.md"}
"""Pages whose commands need files that they show."""
PYTHON_EXAMPLES = {
    **{"README.md": 1, "mitsuba.md": 4, "project.md": 2, "python.md": 6, "triangulation.md": 1}
}


def blocks(page: str, language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGES[page], re.DOTALL)


def commands(page: str) -> list[list[str]]:
    """Every `iriftrace ...` line of a page's shell blocks."""
    lines = "\n".join(blocks(page, "sh")).splitlines()
    return [shlex.split(line, comments=True) for line in lines if line.startswith("iriftrace ")]


def run(arguments: list[str], folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    warnings = [line for line in done.stderr.splitlines() if "warning" in line.lower()]
    # Views along the layers: single poses of the sweep, and the README's camera by 3.0 %.
    expected = ("engine_test_p95", "the field data were traced instead")
    assert all(any(text in line for text in expected) for line in warnings), done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A user's folder, empty but for what the README's commands make."""
    folder = tmp_path_factory.mktemp("user")
    for command in commands("README.md"):
        run(["-m", "iriftrace", *command[1:]], folder)
    return folder


def test_every_shell_block_is_among_the_commands() -> None:
    found = {page: [command[1] for command in commands(page)] for page in PAGES}
    assert {page: names for page, names in found.items() if names} == COMMANDS


@pytest.mark.slow
def test_commands_of_the_readme_run_as_they_stand(folder: Path) -> None:
    assert (folder / "out.exr").is_file()
    assert (folder / "out.json").is_file()
    assert (folder / "out" / "cylinder.png").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("page", sorted(COMMANDS.keys() - {"README.md", *WITH_FILES}))
def test_commands_of_the_pages_run_as_they_stand(page: str, folder: Path) -> None:
    for command in commands(page):
        run(["-m", "iriftrace", *command[1:]], folder)


@pytest.mark.slow
def test_the_tutorial_ends_with_the_sentence_that_it_quotes(tmp_path: Path) -> None:
    page = "tutorial_scanner.md"
    for name, text in zip(("camera", "projector"), blocks(page, "json"), strict=True):
        (tmp_path / f"{name}.json").write_text(text)
    said = [run(["-m", "iriftrace", *words[1:]], tmp_path) for words in commands(page)]
    (quoted,) = re.findall(r"^> (.*)$", PAGES[page], re.MULTILINE)
    number = r"\d+\.?\d*"
    (found,) = (line for line in said[-1].splitlines() if line.startswith("Diameter"))
    assert re.sub(number, "#", found) == re.sub(number, "#", quoted)
    pairs = zip(re.findall(number, found), re.findall(number, quoted), strict=True)
    assert all(float(one) == pytest.approx(float(other), rel=0.02) for one, other in pairs)


@pytest.mark.slow
def test_the_project_ends_with_the_verdict_that_its_page_quotes(tmp_path: Path) -> None:
    page = "project.md"
    demo, new, first, last, *_ = commands(page)
    folder = tmp_path / new[2]
    run(["-m", "iriftrace", *demo[1:]], tmp_path)
    run(["-m", "iriftrace", *new[1:]], tmp_path)
    assert "nothing is decided" in run(["-m", "iriftrace", *first[1:]], folder)
    text, _ = blocks(page, "toml")
    (folder / "iriftrace.toml").write_text(text.replace('cloud = "scan.vtp"', ""))
    run(["-m", "iriftrace", "run", "measure"], folder)
    shutil.copy(folder / "build" / "measure" / "scan.vtp", folder)
    (folder / "iriftrace.toml").write_text(text)
    said = " ".join(run(["-m", "iriftrace", *last[1:]], folder).split())
    quoted, *_ = re.findall(r"^> (.*)$", PAGES[page], re.MULTILINE)
    assert quoted in said


@pytest.mark.slow
def test_the_project_with_a_board_finds_the_size_that_its_page_quotes(tmp_path: Path) -> None:
    page = "project.md"
    part, board, scenes, last = commands(page)[4:]
    of_air, of_hall = blocks(page, "python")
    for words in (part, board):
        run(["-m", "iriftrace", *words[1:]], tmp_path)
    run(["-c", of_air], tmp_path)
    (tmp_path / "iriftrace.toml").write_text(blocks(page, "toml")[1])
    run(["-m", "iriftrace", *scenes[1:]], tmp_path)
    truth = float(run(["-c", of_hall], tmp_path))
    assert f"without the air, {truth:.4f} mm" in PAGES[page]
    said = " ".join(run(["-m", "iriftrace", *last[1:]], tmp_path).split())
    _, fit, size, verdict = re.findall(r"^> (.*)$", PAGES[page], re.MULTILINE)
    assert all(quoted in said for quoted in (fit, size, verdict))
    stamp = json.loads((tmp_path / "build" / "fit" / "step.json").read_text())
    assert stamp["result"] == fit
    corrected, u, *_, measured = map(float, re.findall(r"(\d+\.\d+) mm", size))
    assert abs(corrected - truth) <= u < 0.5 * abs(measured - truth)
    assert "All is up to date." in run(["-m", "iriftrace", *last[1:]], tmp_path)
    # Another picture of the board repeats what follows from it, another place the board's scene.
    for name, repeated in {
        "shifts.csv": ["fit", "correct", "budget", "report"],
        "board_pose.txt": ["board", "fit", "correct", "budget", "report"],
    }.items():
        with (tmp_path / name).open("a") as file:
            file.write("\n")
        said = run(["-m", "iriftrace", *last[1:], "--dry-run"], tmp_path)
        assert re.findall(r"^ +(\w+) +(?!up to date)(?:\S+ changed|after)", said, re.M) == repeated


def test_the_projects_own_hall_has_keys_that_exist(tmp_path: Path) -> None:
    _, text = blocks("project.md", "toml")
    (hall,) = re.findall(
        r"^    \[air\.simulate\]\n(?:    .*\n)+", PAGES["project.md"], re.MULTILINE
    )
    path = tmp_path / "iriftrace.toml"
    path.write_text(re.sub(r"fields = .*", textwrap.dedent(hall), text))
    file = read_project_file(path, app)
    assert file.get("air.simulate", "floor") == "-16 mm"
    assert "field" in steps_of(file)


@pytest.mark.slow
def test_python_examples_run_as_they_stand(folder: Path) -> None:
    found = {page: len(blocks(page, "python")) for page in PAGES}
    assert {page: count for page, count in found.items() if count} == PYTHON_EXAMPLES
    median_mm = float(run(["-c", *blocks("README.md", "python")], folder).splitlines()[0])
    assert 0.001 < median_mm < 0.01
    of_pixels, _, _, in_memory, of_another_camera, of_mitsuba = (
        run(["-c", block], folder) for block in blocks("python.md", "python")
    )
    medians, _, share = of_pixels.splitlines()
    assert float(medians.split()[0]) == pytest.approx(median_mm, rel=1e-6)
    assert 0.1 < float(share) < 0.5
    rendered, scanned = in_memory.splitlines()
    assert rendered.startswith("PoseMetrics(")
    assert scanned.startswith("Scan(")
    assert 0.001 < float(of_another_camera) < 0.01
    assert "displacement.norm" in of_mitsuba
    mean, *features, left = run(["-c", *blocks("triangulation.md", "python")], folder).splitlines()
    assert -0.1 < float(mean) < 0.0
    (change,) = (line.split()[-1] for line in features if line.startswith("cylinder lateral"))
    assert -0.1 < float(change) < 0.0
    assert float(left) < 0.1 * abs(float(mean))


def printed_by(block: str, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Lines that an example prints in this process, which has Mitsuba already."""
    with using("llvm_ad_mono"):
        exec(block, {})
    return capsys.readouterr().out.splitlines()


def test_scene_in_memory_bends_rays(capsys: pytest.CaptureFixture[str]) -> None:
    printed = printed_by(blocks("mitsuba.md", "python")[0], capsys)
    # First-order integral over the formula: 1.88 um at these pixels. 13 shells are within 2 %.
    assert float(printed[0]) == pytest.approx(0.00188, rel=0.02)
    assert printed[-1] == "[0 0 0]"
    found = np.array(re.findall(r"-?\d+\.?\d*e?[+-]?\d*", " ".join(printed[1:-1])), dtype=float)
    lengths = np.linalg.norm(found.reshape(3, 3), axis=1)
    assert lengths == pytest.approx([moved_past_the_ball(x) for x in (0.0, 0.1, 0.15)], rel=0.02)


def moved_past_the_ball(slope: float) -> float:
    """First-order displacement, mm, of a ray through the 1/r air of the page's hot sphere.

    From (0, -100, 0) with this slope to the sphere's axis; the deflection at each place times the
    rest of the path is the offset across the ray, and that over the cosine the one on the sphere.
    """
    radius, outer, contrast, distance = 20.0, 60.0, 2.1e-4, 100.0
    nearest = distance * np.sin(np.arctan(slope))
    end = -np.sqrt(radius**2 - nearest**2)
    place = np.linspace(-np.sqrt(outer**2 - nearest**2), end, 100_001)
    gradient = contrast / (1 / radius - 1 / outer) * nearest / (place**2 + nearest**2) ** 1.5
    aside = float(np.trapezoid(gradient * (end - place), place))
    return aside / (-end / radius)


def test_parallel_rays_meet_behind_the_lens(capsys: pytest.CaptureFixture[str]) -> None:
    (example,) = (b for b in blocks("mitsuba.md", "python") if "Luneburg" in b)
    (largest,) = map(float, printed_by(example, capsys))
    assert largest < 5e-6


def test_the_plugins_command_writes_the_channels_of_a_rendering(tmp_path: Path) -> None:
    folder = Path(shutil.copytree(folder_of("slab"), tmp_path / "slab"))
    (line,) = "".join(blocks("mitsuba.md", "sh")).splitlines()
    run(shlex.split(line)[1:], folder)
    found = read_exr(folder / "channels.exr")
    expected = render_scene(load_scene(folder / "scene.xml", {"scale": 0.25})).image
    for name, pixels in expected.channels.items():
        np.testing.assert_array_equal(found.channels[name], pixels, err_msg=name)


@pytest.mark.filterwarnings("ignore:Mitsuba's own integrators show no true displacement")
def test_the_picture_through_the_air_is_shifted_by_the_channels_numbers() -> None:
    """Each pixel is as bright as the bare part at the place that `shift.px` says is seen there.

    Regression over a thousand pixels of differences of 1e-5 in a radiance of 0.3, which single
    precision rounds to 3e-8.
    """
    script: dict[str, Any] = {}
    with using("llvm_ad_mono"):
        exec("\n".join(blocks("mitsuba.md", "python")[:2]), script)
        channel = dict(zip(script["names"], script["channels"].reshape(64**2, -1).T, strict=True))
        shift = np.stack((channel["shift.px.X"], channel["shift.px.Y"]), axis=1)
        pixels = np.argwhere(np.ones((64, 64)))[:, ::-1]
        rays = script["loaded"].camera.rays
        bare, expected = script["shaded"](*rays()), script["shaded"](*rays(pixels - shift))
    clear = (channel["status.code"] == 0) & (channel["incidence.angle"] < 1.0) & (bare > 0.05)
    assert clear.sum() > 500
    assert np.hypot(*shift[clear].T).max() > 1e-3
    moved, predicted = (
        picture[clear] - bare[clear] for picture in (script["picture"].ravel(), expected)
    )
    assert (moved @ predicted) / (predicted @ predicted) == pytest.approx(1.0, abs=1e-3)


def test_gradient_of_the_displacement_is_that_of_differences(
    capsys: pytest.CaptureFixture[str],
) -> None:
    reverse, differences = map(float, printed_by(blocks("mitsuba.md", "python")[-1], capsys))
    assert reverse == pytest.approx(differences, rel=1e-4)
    assert reverse == pytest.approx(-5.322, abs=0.001)


def test_channel_table_names_every_channel() -> None:
    table = re.findall(r"^\| (`[^|]*`) \|", PAGES["reference_formats.md"], re.MULTILINE)
    named = set()
    for name in re.findall(r"`([^`]+)`", " ".join(table)):
        stem, _, axes = name.rpartition(".")
        named |= {f"{stem}.{axis}" for axis in axes.split("/")} if "/" in axes else {name}
    assert set(CHANNELS) <= named


def test_command_table_names_every_command() -> None:
    table = re.findall(r"^\| (`iriftrace [^|]*`) \|", README, re.MULTILINE)
    named = re.findall(r"`iriftrace (\w+)`", " ".join(table))
    assert sorted(named) == sorted(name for name in app if not name.startswith("-"))


@pytest.mark.parametrize("page", sorted(PAGES))
def test_files_and_sections_that_a_page_names_exist(page: str) -> None:
    beside = CHECKOUT if page == "README.md" else CHECKOUT / "docs"
    for name in re.findall(r"`(tests/[\w/]+\.py)`", PAGES[page]):
        assert (CHECKOUT / name).is_file()
    for link in re.findall(r"\]\(([^)\s]+)\)", PAGES[page]):
        if "://" in link:
            continue
        name, _, section = link.partition("#")
        assert not name or (beside / name).is_file(), link
        if section:
            text = PAGES[Path(name).name] if name else PAGES[page]
            headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
            anchors = {re.sub(r"[^\w -]", "", one.lower()).replace(" ", "-") for one in headings}
            assert section in anchors, link


def test_every_page_is_in_the_contents_of_the_site() -> None:
    listed = {f"{name}.md" for name in re.findall(r"^(\w+)$", PAGES["index.md"], re.MULTILINE)}
    assert listed == PAGES.keys() - {"README.md", "index.md"}

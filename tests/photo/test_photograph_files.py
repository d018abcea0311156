"""Files of ``iriftrace photograph`` and of `Photograph.save`."""

from pathlib import Path

import cv2
import numpy as np
import pytest

import iriftrace
from iriftrace.cli import main
from iriftrace.photo.prints import read_print
from iriftrace.scenes import folder_of

pytestmark = pytest.mark.usefixtures("variant")

SCENE = str(folder_of("fringe_cylinder") / "scene.xml")


@pytest.mark.parametrize("name", ["README.md", "truth.exr"])
def test_another_file_is_not_replaced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    (tmp_path / name).write_text("# My project\n")
    assert main(["photograph", SCENE, "-o", str(tmp_path / "image.tiff"), "-D", "scale=0.05"]) == 2
    assert f"{name}, another file, would be lost" in " ".join(capsys.readouterr().err.split())
    assert [file.name for file in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "# My project\n"


def test_the_command_writes_pictures_truth_and_numbers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    picture = tmp_path / "new" / "image.tiff"
    words = [SCENE, "-o", str(picture), "-D", "scale=0.05", "--samples", "1", "--air", "both"]
    words += ["--temperature", "1000 degC", "--temperature", "head*=900 degC"]
    assert main(["photograph", *words, "--exposure", "2 ms"]) == 0
    assert "Exposure 2 ms" in capsys.readouterr().out
    hot = cv2.imread(str(picture), cv2.IMREAD_UNCHANGED)
    cold = cv2.imread(str(picture.with_name("image_cold.tiff")), cv2.IMREAD_UNCHANGED)
    assert hot.dtype == np.uint16
    truth = iriftrace.read_exr(picture.with_name("truth.exr"))
    part = truth.channels["part.face"] > 0
    assert hot.shape == part.shape
    assert np.median(hot[part]) > 1.5 * np.median(cold[part])
    assert "second.px.X" not in truth.channels
    assert truth.header["photograph"]["sensor"]["exposure"] == 2e-3
    text = picture.with_name("README.md").read_text(encoding="utf-8")
    assert "| part temperature | 1000 degC, head*=900 degC |" in text
    assert truth.header["scene"]["sha256"] in text


def test_fringes_are_numbered_and_can_be_repeated(tmp_path: Path) -> None:
    words = [SCENE, "-D", "scale=0.05", "--samples", "1", "--light", "fringes", "--steps", "3"]
    contents = []
    for folder in ("one", "other"):
        picture = tmp_path / folder / "image.tiff"
        assert main(["photograph", *words, "--lines", "rows", "-o", str(picture)]) == 0
        found = sorted(picture.parent.glob("*.tiff"))
        assert [one.name for one in found] == [f"image_hot_step_{n}.tiff" for n in range(3)]
        contents.append([one.read_bytes() for one in found])
    assert contents[0] == contents[1]
    assert len(set(contents[0])) == 3


def test_the_glow_may_be_that_of_the_fields_wall() -> None:
    scene = iriftrace.load_scene(folder_of("cylinder") / "scene.xml", {"scale": 0.02})
    pictures = [
        iriftrace.photograph(
            scene,
            part=iriftrace.Appearance(temperature=kelvin),
            ambient=0.0,
            samples=1,
            sensor=iriftrace.ImageSensor(exposure=1e-3),
        ).electrons["hot"]
        for kelvin in ("field", "1100 degC")
    ]
    assert pictures[1].max() > 0.0
    # The field's wall has 1100 degC; at its edges the solver's points are somewhat cooler.
    assert np.isclose(*pictures, rtol=0.01).mean() > 0.97


def test_the_boards_own_table_is_read(tmp_path: Path) -> None:
    board = iriftrace.Board((100.0, 80.0), 4.0)
    dots = read_print(str(board.save_centres(tmp_path / "board.csv")))
    places, blur = board.centres[:, :2], np.full((len(board.centres), 2), 0.1)
    np.testing.assert_allclose(dots.ink(places, blur), 1.0)
    np.testing.assert_allclose(dots.ink(places + np.array((2.0, 2.0)), blur), 0.0)
    squares = read_print("10x7", 100.0)
    np.testing.assert_allclose(
        squares.ink(np.array([(-45.0, 30.0), (45.0, 30.0)]), blur[:2]), [1, 0]
    )
    white = np.tile(np.uint8([[0, 255]]), (4, 4))
    cv2.imwrite(str(tmp_path / "stripes.png"), white)
    stripes = read_print(str(tmp_path / "stripes.png"), 8.0)
    np.testing.assert_allclose(stripes.ink(np.array([(-3.5, 0.0), (3.5, 0.0)]), blur[:2]), [1, 0])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["-o", "image.png"], "must end in .tiff"),
        (["-o", "a/image.tiff", "--print", "10x7"], "--print-width"),
        (["-o", "a/image.tiff", "--print", "missing.csv"], "There is no file missing.csv"),
        (["-o", "a/image.tiff", "--emissivity", "3"], "between 0 and 1"),
        (["-o", "a/image.tiff", "--gain", "0"], "Gain of the image sensor is 0"),
        (["-o", "a/image.tiff", "--samples", "0"], "at least 1 sample"),
        (["-o", "a/image.tiff", "--ambient=-1", "--exposure", "5 ms"], "give 0 or more"),
        (["-o", "a/image.tiff", "--seed=-1"], "(--seed)"),
    ],
)
def test_wrong_input_is_refused_in_a_sentence(
    words: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["photograph", SCENE, "-D", "scale=0.05", *words]) == 2
    assert said in capsys.readouterr().err.replace("\n", " ")
    assert not list(tmp_path.rglob("*.tiff"))

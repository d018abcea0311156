"""Fixtures of the tests of whole commands: a user's folder, and the ways of a command to fail."""

import re
import shutil
from hashlib import sha256
from pathlib import Path

import pytest
from cyclopts import CycloptsError
from failing import NINE_POSES, Failing, Refusal, Run

from iriftrace.cli import main, program
from iriftrace.core.runtime import doctor
from iriftrace.figures import pose, space, style
from validation.inputs import hot_block
from validation.inputs.hot_block import HotBlock


@pytest.fixture(scope="session")
def hot(tmp_path_factory: pytest.TempPathFactory) -> HotBlock:
    """A user's folder with a small field, its part and a scene of them that has been rendered."""
    folder = tmp_path_factory.mktemp("hot")
    field, part = hot_block.save(folder)
    scene = folder / "scene" / "scene.xml"
    arguments = ["scene", str(field), str(part), "-o", str(scene), "--layers=4"]
    assert main([*arguments, *hot_block.CAMERA]) == 0
    assert main(["render", str(scene)]) == 0
    return HotBlock(folder, field, part, scene, scene.with_suffix(".exr"))


@pytest.fixture(scope="session")
def sweep(hot: HotBlock, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small sweep of the hot block that keeps its images."""
    file = tmp_path_factory.mktemp("sweep") / "sweep.nc"
    assert main(["sweep", str(hot.scene), "-o", str(file), *NINE_POSES, "--exr"]) == 0
    return file


@pytest.fixture
def scene(hot: HotBlock, tmp_path: Path) -> Path:
    """A copy of the scene folder that a test may spoil; returns its XML."""
    shutil.copytree(hot.scene.parent, tmp_path / "scene")
    return tmp_path / "scene" / "scene.xml"


@pytest.fixture(autouse=True)
def _small_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """A sixteenth of the pixels: what pictures show is looked at in tests/figures."""
    dpi, size_px = style.DPI // 4, tuple(size // 4 for size in space.SIZE_PX)
    for module in (pose, space, style):
        monkeypatch.setattr(module, "DPI", dpi)
    monkeypatch.setattr(space, "SIZE_PX", size_px)


@pytest.fixture
def no_driver(monkeypatch: pytest.MonkeyPatch) -> None:
    """3-D pictures are left out, which take most of the time of a demo."""
    monkeypatch.setattr(doctor, "drawing_trouble", lambda: "no driver")


def contents(folder: Path) -> dict[str, str]:
    """Every name below a folder, with the hash of the files."""
    return {
        str(path.relative_to(folder)): sha256(path.read_bytes()).hexdigest()
        if path.is_file()
        else "folder"
        for path in sorted(folder.rglob("*"))
    }


@pytest.fixture
def fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Failing:
    """Run the program in a fresh folder; returns its only message once all promises are kept."""
    monkeypatch.chdir(tmp_path)
    raised: list[BaseException] = []
    sentence = program.sentence

    def noted(error: Exception) -> str:
        raised.append(error)
        return sentence(error)

    monkeypatch.setattr(program, "sentence", noted)

    def run(*arguments: str | Path) -> Refusal:
        before = contents(tmp_path)
        capsys.readouterr()
        code = main([str(word) for word in arguments])
        said = capsys.readouterr()
        print(said.err)
        assert code == 2, said
        assert "Traceback" not in said.err
        (line,) = [line for line in said.err.splitlines() if not line.startswith("warning:")]
        assert line.startswith("error: ")
        message = line.removeprefix("error: ")
        assert re.match(r"[A-Z0-9`'\"-]|\S*[./]\S*|n - 1", message)
        assert message[-1] in ".!?"
        assert len(message) < 400
        assert contents(tmp_path) == before, "something was written"
        refusal, error = Refusal(message), raised[-1]
        while isinstance(error, CycloptsError) and error.__cause__ is not None:
            error = error.__cause__
        refusal.code = getattr(error, "code", "")
        return refusal

    return run


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Run:
    """Run the program in a fresh folder; returns its output, and only `warns` is a warning."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")

    def program(*arguments: str | Path, warns: str = "") -> str:
        capsys.readouterr()
        code = main([str(word) for word in arguments])
        said = capsys.readouterr()
        assert code == 0, said.err
        warnings = [line for line in said.err.splitlines() if line.startswith("warning:")]
        assert len(warnings) == bool(warns), said.err
        assert re.search(warns, "".join(warnings))
        return said.out

    return program

"""A project at a small scale."""

import shutil
from pathlib import Path

import pytest
from project_file import FILE

from iriftrace.cli import main


@pytest.fixture(scope="module")
def example(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A project as it is written for a part, at a small scale."""
    folder = tmp_path_factory.mktemp("lab") / "my part"
    folder.mkdir()
    assert main(["part", "cylinder", "-o", str(folder / "part.stl"), "--segments=40"]) == 0
    assert main(["new", str(folder), "--part", str(folder / "part.stl")]) == 0
    file = folder / FILE
    text = file.read_text().replace("scale = 0.25", "scale = 0.06")
    file.write_text(
        text.replace(
            "\n[air.synthetic]", "[shells]\nlayers = 3\n[air.synthetic]\ncell_size = '4 mm'"
        )
    )
    return folder


@pytest.fixture
def project(example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of it, as the current folder."""
    folder = shutil.copytree(example, tmp_path / "project")
    monkeypatch.chdir(folder)
    return folder

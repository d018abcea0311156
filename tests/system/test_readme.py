"""Everything the README tells the reader to type is typed here."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import trimesh

from iriftrace.channels import CHANNELS
from iriftrace.scenes import folder_of

README = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def commands() -> list[list[str]]:
    """Every `iriftrace ...` line of the README's shell blocks."""
    lines = "\n".join(blocks("sh")).splitlines()
    return [shlex.split(line, comments=True) for line in lines if line.startswith("iriftrace ")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A user's folder with a field and a part."""
    folder = tmp_path_factory.mktemp("user")
    shutil.copy(folder_of("cylinder") / "field.vtu", folder)
    shutil.copy(folder_of("cylinder") / "part.ply", folder)
    trimesh.load(folder / "part.ply", process=False).export(folder / "part.stl")
    return folder


def run(arguments: list[str], folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "warning" not in done.stderr.lower()
    return done.stdout


def test_commands_run_as_they_stand(folder: Path) -> None:
    assert [c[1] for c in commands()] == [
        *("doctor", "demo", "scene", "render", "metrics", "field", "field"),
        *("sweep", "plan", "plan", "plan", "plot", "report"),
    ]
    for command in commands():
        run(["-m", "iriftrace.cli", *command[1:]], folder)
    assert (folder / "out.exr").is_file()
    assert (folder / "out.json").is_file()
    assert (folder / "out" / "cylinder.png").is_file()


def test_python_examples_run_as_they_stand(folder: Path) -> None:
    first, second = blocks("python")
    median_mm = float(run(["-c", first], folder).splitlines()[0])
    assert 0.001 < median_mm < 0.01
    assert "displacement.norm" in run(["-c", second], folder)


def test_channel_table_names_every_channel() -> None:
    table = re.findall(r"^\| (`[^|]*`) \|", README, re.MULTILINE)
    named = set()
    for name in re.findall(r"`([^`]+)`", " ".join(table)):
        stem, _, axes = name.rpartition(".")
        named |= {f"{stem}.{axis}" for axis in axes.split("/")} if "/" in axes else {name}
    assert set(CHANNELS) <= named


def test_files_that_the_readme_names_exist() -> None:
    root = Path(__file__).parents[2]
    for name in re.findall(r"`(tests/[\w/]+\.py)`|\]\((docs/\w+\.png)\)", README):
        assert (root / "".join(name)).is_file()

"""Files that may not be read, are not where they were, are damaged, or are another one's."""

import errno
import os
import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from failing import Failing

from iriftrace.cli import main
from iriftrace.io.field_npz import FIELD_FILE
from iriftrace.io.ply import write_ply_points
from validation.inputs.hot_block import CAMERA, HotBlock


@pytest.fixture
def closed(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Takes the permission from a file, also where the tests are root's, who may read anything."""
    opened = Path.open

    def close(name: str) -> None:
        def refuse(self: Path, *more: Any, **options: Any) -> Any:
            if self.name == name:
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(self))
            return opened(self, *more, **options)

        monkeypatch.setattr(Path, "open", refuse)

    return close


COMMANDS = {
    "part": ("field synthetic block.stl -o out.vtu", "block.stl"),
    "part of a scene": ("scene air.vtu block.stl -o out/scene.xml", "block.stl"),
    "field": ("shells air.vtu -o out", "air.vtu"),
    "image": ("metrics scene/scene.exr", "scene/scene.exr"),
    "sweep": ("plan s.nc", "s.nc"),
    "scene": ("render scene/scene.xml -o out.exr", "scene/scene.xml"),
    "the scene's part": ("render scene/scene.xml -o out.exr", "scene/part.ply"),
    "the scene's shell": ("render scene/scene.xml -o out.exr", "scene/shells/shell_02.ply"),
    "the scene's field": (
        "render scene/scene.xml -o out.exr --engine cells",
        f"scene/{FIELD_FILE}",
    ),
}


@pytest.mark.parametrize(("line", "name"), COMMANDS.values(), ids=COMMANDS.keys())
def test_without_permission_a_file_is_not_called_damaged(
    hot: HotBlock,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    closed: Callable[[str], None],
    line: str,
    name: str,
) -> None:
    shutil.copytree(hot.folder, tmp_path, dirs_exist_ok=True)
    (tmp_path / "s.nc").touch()
    monkeypatch.chdir(tmp_path)
    capsys.readouterr()
    closed(Path(name).name)
    assert main(line.split()) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    # The engine names its field by the absolute path.
    assert said.replace(f"{tmp_path}{os.sep}", "") == (
        f"error: Cannot read {name}: Permission denied."
    )


@pytest.mark.parametrize("gone", ["part.ply", "shells/shell_02.ply"])
def test_a_scene_that_was_moved_without_its_meshes(scene: Path, fails: Failing, gone: str) -> None:
    (scene.parent / gone).unlink()
    refusal = fails("render", "scene/scene.xml", "-o", "out.exr")
    assert refusal.startswith(f"{gone} is not next to scene/scene.xml; ")
    assert refusal.code == "file.missing"


@pytest.mark.parametrize("name", ["part.ply", "shells/shell_01.ply"])
def test_corners_that_a_scenes_mesh_lacks(scene: Path, fails: Failing, name: str) -> None:
    """Mitsuba takes them as they are, and what it finds there is no vertex."""
    mesh = scene.parent / name
    head, end, body = mesh.read_bytes().partition(b"end_header\n")
    count = int(head.partition(b"element vertex ")[2].split()[0])
    floats = head.partition(b"element face")[0].count(b"property float")
    corner = 4 * floats * count + 1
    mesh.write_bytes(head + end + body[:corner] + b"\xff\xff" + body[corner + 2 :])
    said = fails("render", "scene/scene.xml", "-o", "out.exr", "--engine", "shells")
    assert re.search(f"{name} .*vertex 65535", said)
    assert said.code == "file.damaged"


def test_points_alone_are_no_part(scene: Path, fails: Failing) -> None:
    """As a cloud that was written over the scene's part."""
    write_ply_points(scene.parent / "part.ply", np.zeros((3, 3)), {})
    for words in (["render"], ["render", "--engine=cells"], ["sweep", "-o", "s.nc"]):
        assert fails(words[0], "scene/scene.xml", *words[1:]).code == "part.no_triangles"


def test_a_scene_replaces_no_part_of_another(hot: HotBlock, tmp_path: Path, fails: Failing) -> None:
    """The user's own part.ply in the folder; beside a scene it is that scene's copy."""
    mine = tmp_path / "part.ply"
    mine.write_bytes(b"mine")
    words = ["scene", str(hot.field), str(hot.part), "-o"]
    refusal = fails(*words, "scene.xml")
    assert re.search("part.ply.* scene/scene.xml ", refusal)
    assert refusal.code == "output.replaces"
    assert mine.read_bytes() == b"mine"
    mine.unlink()
    (tmp_path / "unrelated.xml").write_text("<map/>")
    for name in ("scene.xml", "scene.xml", "other.xml"):
        assert main([*words, str(tmp_path / name), "--layers=3", *CAMERA]) == 0

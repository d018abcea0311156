"""A user's folder with a small field, its part and a scene of them that has been rendered."""

from __future__ import annotations

import hot_block
import pytest
from hot_block import HotBlock

from iriftrace.cli import main


@pytest.fixture(scope="session")
def hot(tmp_path_factory: pytest.TempPathFactory) -> HotBlock:
    folder = tmp_path_factory.mktemp("hot")
    field, part = hot_block.save(folder)
    scene = folder / "scene" / "scene.xml"
    arguments = ["scene", str(field), str(part), "-o", str(scene), "--layers=4"]
    assert main([*arguments, *hot_block.CAMERA]) == 0
    assert main(["render", str(scene)]) == 0
    return HotBlock(folder, field, part, scene, scene.with_suffix(".exr"))

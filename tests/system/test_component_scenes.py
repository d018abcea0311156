"""The components' scenes hold the parts and cameras of their script, and are small."""

import json
from pathlib import Path

import numpy as np
import pytest

from iriftrace.cli import main
from iriftrace.io.part_files import read_part
from iriftrace.io.shells import load_shells
from iriftrace.medium.shells.report import DATA_BOUNDARY, PART_WALL
from iriftrace.scenes import folder_of, shells_of
from iriftrace.tracing.write import write_scene
from iriftrace.tracing.xml import SceneSettings
from scenes.generators.bevel_gear import TOOTH, bevel_gear
from scenes.generators.components import COMPONENTS, LAYERS, TOOTH_NUMBER, TOOTH_SCENE, write_tooth

MOST_BYTES = 2_600_000


@pytest.mark.parametrize("name", COMPONENTS)
def test_a_scene_is_what_its_script_writes(name: str, tmp_path: Path) -> None:
    """But for the shells, whose field is too large for the tree."""
    folder, component = folder_of(name), COMPONENTS[name]
    made, kept = component.part(), read_part(folder / "part.ply")
    assert kept.region_names == made.region_names
    assert np.array_equal(kept.faces, made.faces)
    assert np.array_equal(kept.region_of_face, made.region_of_face)
    assert np.allclose(kept.vertices, made.vertices, atol=1e-4)
    stack = load_shells(folder / "shells")
    assert len(stack.shells) == LAYERS
    assert stack.source.origin == component.field_origin
    assert stack.triangles == pytest.approx(component.triangles, rel=0.01)
    xml = write_scene(
        tmp_path,
        made,
        stack,
        component.camera(),
        SceneSettings(scale=component.scale),
        paraview=False,
    )
    assert xml.read_text() == (folder / "scene.xml").read_text()
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    assert size < MOST_BYTES


def test_the_tooth_has_a_region_and_the_gear_s_shells(tmp_path: Path) -> None:
    folder = folder_of(TOOTH_SCENE)
    assert shells_of(TOOTH_SCENE) == folder_of("bevel_gear") / "shells"
    assert not (folder / "shells").exists()
    written = write_tooth(tmp_path, folder_of("bevel_gear"))
    assert written.read_text() == (folder / "scene.xml").read_text()
    part = read_part(folder / "part.ply")
    assert np.array_equal(part.region_of_face, bevel_gear(tooth=TOOTH_NUMBER).region_of_face)
    assert part.region_names[0] == TOOTH


@pytest.mark.parametrize("name", COMPONENTS)
def test_thinned_shells_are_open_at_data_and_wall_alone(name: str) -> None:
    """Holes inside would break the sum of a ray's index steps."""
    table = json.loads((folder_of(name) / "shells" / "shells.json").read_text())
    assert {place for row in table["shells"] for place in row["open_at"]} <= {
        DATA_BOUNDARY,
        PART_WALL,
    }


@pytest.mark.usefixtures("no_driver")
def test_the_demo_brings_the_shells_that_a_scene_borrows(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["demo", "--scene", TOOTH_SCENE, "-o", str(out), "-D", "scale=0.05"]) == 0
    metrics = json.loads((out / f"{TOOTH_SCENE}.json").read_text())
    assert metrics["regions"][TOOTH]["displacement_mm"]["median"] > 0.0
    assert (out / "bevel_gear" / "shells" / "shell_13.ply").is_file()

"""Every bundled scene gives what its README says, and is what its script writes."""

import json
import re
from pathlib import Path

import pytest

from iriftrace.scenes import folder_of, names
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.render import render_scene
from scenes.generators.bundled import write_bundled, write_plate

COLUMNS = ("good", "missed", "out_of_focus", "refracted_missed", "index_mismatch")


def expected_counts() -> dict[str, dict[str, int]]:
    """The table of scenes/README.md."""
    text = (folder_of("cylinder").parent / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)` \|.*?((?: \d+ \|)+)$", text, re.MULTILINE)
    return {
        name: dict(zip(COLUMNS, map(int, re.findall(r"\d+", numbers)), strict=True))
        for name, numbers in rows
    }


# The others take as long and show the same; each has tests of its own.
QUICK = ("cylinder", "slab")


@pytest.mark.filterwarnings("ignore:Hits of this view")
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in names()],
)
@pytest.mark.usefixtures("variant")
def test_rays_by_status_are_those_of_the_readme(name: str) -> None:
    # Rays along the plate enter its shells at their open ends.
    engine = "cells" if name == "hot_plate" else "shells"
    metrics = render_scene(load_scene(folder_of(name) / "scene.xml", engine=engine)).metrics
    rays = metrics.rays
    for key, count in expected_counts()[name].items():
        assert getattr(rays, key) == pytest.approx(count, abs=max(3, 1e-5 * rays.launched))
    assert rays.gave_up == rays.only_refracted == 0
    assert (rays.blocked > 0) == (name == "hot_plate"), "the plate hides part of the board"
    line = (folder_of(name) / "README.md").read_text(encoding="utf-8")
    median_um = float(re.search(r"median displacement ([\d.]+) um", line)[1])
    assert metrics.displacement_mm.median * 1e3 == pytest.approx(median_um, abs=0.06)


@pytest.mark.slow
def test_the_script_writes_the_bundled_scenes(tmp_path: Path) -> None:
    """The files in the tree are not older than the program: XML equal, meshes of equal size."""
    for xml in [*write_bundled(tmp_path), write_plate(tmp_path)]:
        bundled = folder_of(xml.parent.name)
        assert xml.read_text() == (bundled / "scene.xml").read_text()
        made, kept = (
            json.loads((folder / "shells" / "shells.json").read_text())["source"]
            for folder in (xml.parent, bundled)
        )
        assert made == kept
        # Exact cases come from no file.
        assert made is None or made["origin"].startswith(("OpenFOAM", "steady boundary"))
        for mesh in xml.parent.rglob("*.ply"):
            twin = bundled / mesh.relative_to(xml.parent)
            assert twin.stat().st_size == mesh.stat().st_size

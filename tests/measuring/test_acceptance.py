"""Errors that VDI/VDE 2634 part 2 tests, where they are known: even air and plane layers."""

import json
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

from iriftrace.camera.camera import Camera
from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.measuring.two_devices.acceptance import acceptance
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.regions import Regions
from iriftrace.part.standards import ball_bar, cylinder, plate, sphere
from iriftrace.scenes.analytic import slab
from iriftrace.scenes.closed_forms import slab_pair_error_um
from iriftrace.tracing.write import write_scene
from iriftrace.tracing.xml import SceneSettings
from validation.inputs.cameras import camera_at
from validation.inputs.scene_rays import loaded
from validation.oracles.exact_layers import RoundAir

SAGITTA_MM = 12.5 * (1 - np.cos(np.pi / 240))
"""Depth of a sphere's chords below it; at most twice that below its triangles."""


def device(angle_deg: float, field_mm: float, pixels: int) -> Camera:
    """300 mm from the origin, at an angle to the vertical."""
    angle = np.radians(angle_deg)
    return camera_at(
        (300 * np.sin(angle), 0.1, 300 * np.cos(angle)),
        up=(0, 1, 0),
        focal_length_mm=300.0,
        sensor_mm=(field_mm, field_mm),
        resolution=(pixels, pixels),
    )


def below(part: Part, depth_mm: float) -> Part:
    moved = part.vertices - (0.0, 0.0, depth_mm)
    regions = Regions(part.region_of_face, part.region_names)
    return part_of_mesh(moved, part.faces, name="part", regions=regions)


@pytest.mark.parametrize(("part", "field_mm"), [(sphere(), 30.0), (ball_bar(), 130.0)])
def test_in_even_air_only_the_tessellation_errs(
    part: Part, field_mm: float, variant: str, tmp_path: Path
) -> None:
    _, shells = slab(13, air=RoundAir())
    even = [evolve(s, ext=shells.shells[0].ext, int_=shells.shells[0].ext) for s in shells.shells]
    placed = below(part, 13.0)
    scene = loaded(tmp_path, placed, evolve(shells, shells=even), bending="shells")
    scan = measure(scene, device(-15, field_mm, 120), device(15, field_mm, 120), system="stereo")
    tested = acceptance(scan.features(placed), placed)
    terms = ["probing error of form", "probing error of size"] * len(part.region_names)
    assert [each.error for each in tested] == [
        *terms,
        *(["sphere-spacing error"] if len(part.region_names) == 2 else []),
    ]
    for each in tested:
        cold, measured = each.error_mm["cold"], each.error_mm["measured"]
        assert measured == pytest.approx(cold, abs=1e-6)
        if each.error == "probing error of form":
            assert 0 < cold < 2 * SAGITTA_MM
        elif each.error == "probing error of size":
            assert -4 * SAGITTA_MM < cold < 0
        else:
            assert abs(cold) < 2 * SAGITTA_MM


def test_a_plate_under_plane_layers_stays_flat(variant: str, tmp_path: Path) -> None:
    """It is measured too deep by 3.4 um, and the depth changes by nanometres over a millimetre."""
    _, shells = slab(13, air=RoundAir())
    part = plate()
    scan = measure(
        loaded(tmp_path, part, shells), device(-15, 1.0, 12), device(15, 1.0, 12), system="stereo"
    )
    (flatness,) = acceptance(scan.features(part), part)
    assert flatness.error == "flatness error"
    assert flatness.error_mm["cold"] < 1e-6
    depth_um, _ = slab_pair_error_um(np.tan(np.radians(-15)), np.tan(np.radians(15)))
    assert -1e3 * scan.error_normal.mean() == pytest.approx(depth_um, rel=0.02)
    assert 1e3 * flatness.error_mm["measured"] < 0.01 * depth_um


def test_a_part_without_spheres_and_planes_is_refused() -> None:
    with pytest.raises(InputError, match="nothing to test"):
        acceptance([], cylinder())


def test_the_command_says_the_errors(
    variant: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _, shells = slab(13, air=RoundAir())
    two = SceneSettings(scale=1.0, second=device(15, 1.0, 12))
    xml = write_scene(tmp_path / "scene", plate(), shells, device(-15, 1.0, 12), two)
    cloud = tmp_path / "scan.ply"
    words = ["measure", str(xml), "-o", str(cloud), "--acceptance", "--no-figures"]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "Flatness error (plane +z (z 0 mm))" in said
    assert "Plane (plane +z (z 0 mm)): form deviation" in said
    assert "\n  plane +z (z 0" in said, "in the table of regions"
    (row,) = json.loads(cloud.with_suffix(".json").read_text())["acceptance"]
    assert row["region"] == "plane +z"

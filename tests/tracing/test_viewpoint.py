"""Cameras that see the whole part, and what share of it those miss that do not.

Expected values are the solid angle of a rectangle and the rays of the bundled cylinder's camera.
"""

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from attrs import evolve

from iriftrace.camera.camera import Camera
from iriftrace.camera.distortion import Distortion
from iriftrace.camera.pose import look_at
from iriftrace.cli import main
from iriftrace.io.part_files import read_part
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.scenes import folder_of
from iriftrace.scenes.analytic import concentric_cylinders
from iriftrace.tracing.viewpoint import default_viewpoint, part_view
from validation.inputs import hot_block

CAMERA = Camera(
    focal_length_mm=10.0, sensor_mm=(6.7, 5.6), resolution=(2448, 2048), focus_mm=(50.0, 250.0)
)


def solid_angle(x: float, y: float, distance: float) -> float:
    """Of a rectangle with one corner on the axis, sr."""
    return math.atan(x * y / (distance * math.sqrt(x * x + y * y + distance * distance)))


def of(mesh: trimesh.Trimesh) -> Part:
    return part_of_mesh(mesh.vertices, mesh.faces, name="a part")


def shapes() -> dict[str, Part]:
    """A disc with a bore, a long twisted blade, and a bowl."""
    blade = trimesh.creation.box((250.0, 60.0, 4.0)).subdivide().subdivide()
    angle = np.radians(40.0) * blade.vertices[:, 0] / 250.0
    y, z = blade.vertices[:, 1:].T.copy()
    blade.vertices[:, 1] = np.cos(angle) * y - np.sin(angle) * z
    blade.vertices[:, 2] = np.sin(angle) * y + np.cos(angle) * z
    bowl = trimesh.creation.icosphere(subdivisions=3, radius=80.0)
    bowl.update_faces(bowl.triangles_center[:, 2] < 30.0)
    bowl.remove_unreferenced_vertices()
    with pytest.warns(match="not closed"):
        opened = of(bowl)
    flange = trimesh.creation.annulus(r_min=25.0, r_max=60.0, height=18.0)
    return {"flange": of(flange), "blade": of(blade), "bowl": opened}


def test_the_share_outside_is_that_of_the_solid_angle() -> None:
    """A plate of 60 x 40 mm, 100 mm away: the picture holds 33.5 x 28 mm of each quarter."""
    plate = of(trimesh.creation.box((120.0, 80.0, 1e-6)))
    camera = CAMERA.at(look_at((0.0, 0.0, 100.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    seen = solid_angle(33.5, 28.0, 100.0) / solid_angle(60.0, 40.0, 100.0)
    view = part_view(plate, camera)
    assert view.outside == pytest.approx(1.0 - seen, abs=0.002)
    assert view.out_of_focus == 0.0
    far = evolve(camera, focus_mm=(0.0, 90.0))
    assert part_view(plate, far).out_of_focus == pytest.approx(seen, abs=0.002)
    behind = camera.at(look_at((0.0, 0.0, 100.0), (0.0, 0.0, 200.0)))
    assert part_view(plate, behind).outside == 1.0


def test_the_share_out_of_focus_is_that_of_the_rays() -> None:
    """Of the bundled cylinder: 23036 of 289111 rays that hit it, as the scenes' table has it."""
    part = read_part(folder_of("cylinder") / "part.ply")
    view = part_view(part, CAMERA.at(look_at((150.0, -100.0, 120.0), (0.0, 0.0, 0.0))))
    assert view.out_of_focus / (1.0 - view.outside) == pytest.approx(23036 / 289111, abs=0.003)
    assert 0.03 < view.outside < 0.04


@pytest.mark.parametrize("name", ["flange", "blade", "bowl"])
@pytest.mark.parametrize("lens", ["usual", "long", "distorted"])
def test_the_default_camera_sees_the_whole_part(name: str, lens: str) -> None:
    camera = {
        "usual": CAMERA,
        "long": evolve(CAMERA, focal_length_mm=100.0),
        "distorted": evolve(CAMERA, distortion=Distortion(k1=-0.1)),
    }[lens]
    part, (_, shells) = shapes()[name], concentric_cylinders(2, sections=20)
    placed = camera.at(default_viewpoint(part, None, shells, camera))
    assert part_view(part, placed).outside == 0.0
    place = placed.project(part.vertices)
    filled = (np.ptp(place, axis=0) / camera.resolution).max()
    assert 0.5 < filled <= 0.96


def test_commands_say_what_a_picture_does_not_hold(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    hot_block.save(tmp_path)
    words = ["scene", str(tmp_path / "air.vtu"), str(tmp_path / "block.stl"), "--layers=2"]
    cut, whole = (tmp_path / name / "scene.xml" for name in ("cut", "whole"))
    assert main([*words, "-o", str(cut), "--origin=60,-45,70", "--target=21,28,0"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "outside the picture; change its place (--origin), or leave out --origin" in printed
    assert main([*words, "-o", str(cut.parents[1] / "near" / "scene.xml"), "--focus=1:2"]) == 0
    printed = " ".join(capsys.readouterr().out.split())
    assert "out of focus; change its place (--origin) or its --focus, or leave out" in printed
    assert main([*words, "-o", str(whole)]) == 0
    assert "outside the picture" not in capsys.readouterr().out
    for scene, said in ((cut, True), (whole, False)):
        assert main(["render", str(scene), "-D", "scale=0.02", "--no-figures"]) == 0
        assert (
            "outside the picture; move the camera in the scene's file" in capsys.readouterr().out
        ) is said

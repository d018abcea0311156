"""Scenes of hot components in air that was simulated: hybrid cylinder, bevel gear, wishbone, tooth.

The flow solutions are too large for this tree; :mod:`scenes.generators.bundled` is given their
files. Of their shells the tree keeps thinned out ones.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from attrs import evolve, frozen

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.core.arrays import FloatArray
from iriftrace.core.files import whole_file
from iriftrace.io.field import read_field
from iriftrace.io.part_files import save_part
from iriftrace.io.shells import load_shells
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.decimate import decimate
from iriftrace.medium.shells.report import report_shells
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.part.part import Part
from iriftrace.tracing.hot_air import AirState
from iriftrace.tracing.write import SHELLS_FOLDER, write_scene
from iriftrace.tracing.xml import PART_FILE, SceneSettings, scene_xml, shell_shapes
from scenes.generators.bevel_gear import TOOTH, bevel_gear
from scenes.generators.hybrid_cylinder import hybrid_cylinder
from scenes.generators.wishbone import wishbone

LAYERS = 13
SCALE = 0.25
TOOTH_SCENE = "gear_tooth"
TOOTH_NUMBER = 0
_TOOTH_VIEW_MM = (80.0, -25.0, 60.0)
"""From the tooth to the camera."""


@frozen
class Component:
    """A part in its simulated air, and how it is shown."""

    part: Callable[[], Part]
    triangles: int  # of all shells together, after thinning out
    origin_mm: tuple[float, float, float]  # of the camera, which looks at the part's middle
    focus_mm: tuple[float, float]  # nearest and farthest sharp distance
    field_origin: str  # how the field was made
    time: str  # this and the symmetry are notes on the field, stated in every result
    symmetry: str
    scale: float = SCALE  # factor on the resolution; every face in view should have some rays

    def camera(self) -> Camera:
        """The scene's camera."""
        return scene_camera(self.origin_mm, (0.0, 0.0, 0.0), self.focus_mm)


COMPONENTS = {
    "hybrid_cylinder": Component(
        hybrid_cylinder,
        triangles=66_000,
        origin_mm=(150.0, -100.0, 120.0),
        focus_mm=(50.0, 250.0),
        field_origin="OpenFOAM buoyantPimpleFoam, state at 2 s",
        time="snapshot",
        symmetry="half was solved and mirrored",
    ),
    "bevel_gear": Component(
        bevel_gear,
        triangles=50_000,
        origin_mm=(105.0, -70.0, 85.0),
        focus_mm=(50.0, 250.0),
        field_origin="OpenFOAM buoyantPimpleFoam, density averaged over 1 s",
        time="mean",
        symmetry="a quarter was solved and mirrored",
    ),
    "wishbone": Component(
        wishbone,
        triangles=50_000,
        origin_mm=(120.0, -220.0, 220.0),
        focus_mm=(50.0, 450.0),
        field_origin="OpenFOAM buoyantPimpleFoam, density averaged over 0.6 s",
        time="mean",
        symmetry="half was solved and mirrored",
        scale=0.5,
    ),
}


def shells_around(name: str, field_path: Path) -> ShellStack:
    """All triangles of the shells of a component's field."""
    field = read_field(field_path)
    # Named as the user's own would be, and not where this machine has it.
    source = evolve(field.source, path=field_path.name, origin=COMPONENTS[name].field_origin)
    return contour_shells(evolve(field, source=source), LAYERS)


def write_component(folder: Path, name: str, field_path: Path) -> Path:
    """Write one of `COMPONENTS` with its field's shells; returns the XML file."""
    component = COMPONENTS[name]
    part = component.part()
    stack = decimate(shells_around(name, field_path), component.triangles)
    report = report_shells(stack, read_field(field_path), part)
    return write_scene(
        folder / name,
        part,
        AirState(None, ready=stack, report=report),
        component.camera(),
        SceneSettings(
            scale=component.scale, notes={"time": component.time, "symmetry": component.symmetry}
        ),
        paraview=False,
    )


def write_tooth(folder: Path, gear: Path) -> Path:
    """Write the scene of one tooth, in the shells of the gear's scene beside it, `gear`."""
    part = bevel_gear(tooth=TOOTH_NUMBER)
    middle = tooth_centre(part)
    camera = scene_camera(tuple(middle + _TOOTH_VIEW_MM), tuple(middle), (50.0, 250.0))
    return write_beside(folder / TOOTH_SCENE, gear, part, camera, SceneSettings(scale=SCALE))


def write_beside(
    target: Path, other: Path, part: Part, camera: Camera, settings: SceneSettings
) -> Path:
    """Write a scene beside another one, in whose shells its part lies; returns the XML file.

    The name of the other scene's folder is what the new scene refers to; the rest is as for
    `iriftrace.tracing.write.write_scene`.
    """
    target.mkdir(parents=True, exist_ok=True)
    save_part(part, target / PART_FILE)
    stack = load_shells(other / SHELLS_FOLDER)
    meshes = [Path(f"shell_{shell.layer:02d}.ply") for shell in stack.shells]
    shapes = shell_shapes(stack, meshes, f"../{other.name}/{SHELLS_FOLDER}")
    origin = stack.source.origin if stack.source else ""
    xml = target / "scene.xml"
    with whole_file(xml) as temporary:
        text = scene_xml(camera, settings, shapes, f"Field: {origin}")
        temporary.write_text(text, encoding="utf-8")
    return xml


def tooth_centre(part: Part) -> FloatArray:
    """(3,) array, mm: middle of the surface of the region `TOOTH`, rounded to 0.1 mm."""
    own = part.region_of_face == part.region_names.index(TOOTH)
    middle = np.average(part.face_centres[own], axis=0, weights=part.face_areas[own])
    return np.asarray(np.round(middle, 1) + 0.0)


def scene_camera(
    origin: tuple[float, ...], target: tuple[float, ...], focus: tuple[float, float]
) -> Camera:
    """The camera of the bundled scenes, of 5 million pixels, at a place; all in mm."""
    return Camera(
        focal_length_mm=10.0,
        sensor_mm=(6.7, 5.6),
        resolution=(2448, 2048),
        focus_mm=focus,
        matrix=look_at(origin, target),
    )

"""Scenes written into a temporary folder, for tests that trace rays of their own."""

from __future__ import annotations

from pathlib import Path

from iriftrace.camera.camera import Camera
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.part.part import Part
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.write import write_scene
from validation.inputs.cameras import camera_at

ANY_CAMERA = camera_at((0.0, -200.0, 150.0), sensor_mm=(6.7, 5.6), resolution=(153, 128))


def loaded(
    folder: Path, part: Part, shells: ShellStack, camera: Camera = ANY_CAMERA, **variables: object
) -> Scene:
    """Write a scene and load it."""
    return load_scene(
        write_scene(folder, part, shells, camera, paraview=False), variables, engine="shells"
    )

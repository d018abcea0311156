"""The bundled cylinder at a tenth of its resolution, and the orbit around it."""

import pytest

from iriftrace.camera.orbit import Orbit
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene


@pytest.fixture(scope="module")
def scene(variant: str) -> Scene:
    return load_scene(folder_of("cylinder") / "scene.xml", {"scale": 0.1}, variant=variant)


@pytest.fixture(scope="module")
def orbit(scene: Scene) -> Orbit:
    return Orbit(centre=scene.part.centre, semi_axes_mm=(310.0, 238.5, 238.5))

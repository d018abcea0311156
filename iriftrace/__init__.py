"""iriftrace: how hot air around a part displaces what a camera sees of it.

The names below are imported when they are first used, so that ``import iriftrace`` needs neither
Mitsuba nor VTK.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from iriftrace.air.refractivity import Air as Air
    from iriftrace.camera.camera import Camera as Camera
    from iriftrace.camera.pose import look_at as look_at
    from iriftrace.field.index_field import IndexField as IndexField
    from iriftrace.field.read import read_field as read_field
    from iriftrace.image.aov_image import AovImage as AovImage
    from iriftrace.image.aov_image import read_exr as read_exr
    from iriftrace.image.coverage import seen_areas as seen_areas
    from iriftrace.image.displacement import displacement_map as displacement_map
    from iriftrace.image.displacement import shift_map as shift_map
    from iriftrace.image.metrics import pose_metrics as pose_metrics
    from iriftrace.part.part import Part as Part
    from iriftrace.part.part import read_part as read_part
    from iriftrace.scene.load import load_scene as load_scene
    from iriftrace.scene.write import write_scene as write_scene
    from iriftrace.shells.contour import contour_shells as contour_shells
    from iriftrace.trace.render import render_scene as render_scene
    from iriftrace.trace.render import trace_rays as trace_rays

    __version__: str

_HOME = {
    "Air": "air.refractivity",
    "AovImage": "image.aov_image",
    "Camera": "camera.camera",
    "IndexField": "field.index_field",
    "Part": "part.part",
    "contour_shells": "shells.contour",
    "displacement_figure": "figures.pose",
    "displacement_map": "image.displacement",
    "import_shells": "shells.imported",
    "load_scene": "scene.load",
    "look_at": "camera.pose",
    "pose_metrics": "image.metrics",
    "read_exr": "image.aov_image",
    "read_field": "field.read",
    "read_part": "part.part",
    "render_scene": "trace.render",
    "seen_areas": "image.coverage",
    "shift_map": "image.displacement",
    "trace_rays": "trace.render",
    "write_scene": "scene.write",
}

__all__ = sorted([*_HOME, "__version__"])


def __getattr__(name: str) -> Any:
    if name == "__version__":
        # Looking it up takes longer than Python's own start.
        return import_module("importlib.metadata").version("iriftrace")
    if name not in _HOME:
        raise AttributeError(f"module 'iriftrace' has no attribute '{name}'")
    return getattr(import_module(f"iriftrace.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return list(__all__)

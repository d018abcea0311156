"""iriftrace: how hot air around a part displaces what a camera sees of it.

The names below are imported when they are first used, so that ``import iriftrace`` needs neither
Mitsuba nor VTK.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from iriftrace.air import Air as Air
    from iriftrace.camera import Camera as Camera
    from iriftrace.camera import look_at as look_at
    from iriftrace.coverage import seen_areas as seen_areas
    from iriftrace.displacement import displacement_map as displacement_map
    from iriftrace.displacement import shift_map as shift_map
    from iriftrace.exr import AovImage as AovImage
    from iriftrace.exr import read_exr as read_exr
    from iriftrace.field import IndexField as IndexField
    from iriftrace.field import read_field as read_field
    from iriftrace.metrics import pose_metrics as pose_metrics
    from iriftrace.part import Part as Part
    from iriftrace.part import read_part as read_part
    from iriftrace.render import render_scene as render_scene
    from iriftrace.render import trace_rays as trace_rays
    from iriftrace.scene import load_scene as load_scene
    from iriftrace.scene import write_scene as write_scene
    from iriftrace.shells import contour_shells as contour_shells

    __version__: str

_HOME = {
    "Air": "air",
    "AovImage": "exr",
    "Camera": "camera",
    "IndexField": "field",
    "Part": "part",
    "contour_shells": "shells",
    "displacement_figure": "figures",
    "displacement_map": "displacement",
    "import_shells": "shell_import",
    "load_scene": "scene",
    "look_at": "camera",
    "pose_metrics": "metrics",
    "read_exr": "exr",
    "read_field": "field",
    "read_part": "part",
    "render_scene": "render",
    "seen_areas": "coverage",
    "shift_map": "displacement",
    "trace_rays": "render",
    "write_scene": "scene",
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

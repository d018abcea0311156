"""Parameters of a scene, kept to notice that `mi.traverse` has changed them since."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi


def scene_state(scene: mi.Scene, *, sensors: bool = True) -> dict[str, object]:
    """Parameters of a scene by name, as they are now; on request without those of its sensors."""
    left_out = () if sensors else tuple(f"{sensor.id()}." for sensor in scene.sensors())
    # A copy of an array shares its memory, and keeps Dr.Jit from giving its number to another.
    return {
        name: type(value)(value) if _is_array(value) else str(value)
        for name, value in mi.traverse(scene)
        if not name.startswith(left_out)
    }


def same_state(one: dict[str, object], other: dict[str, object]) -> bool:
    """True if no parameter was given a new value in between."""
    return {name: _mark(value) for name, value in one.items()} == {
        name: _mark(value) for name, value in other.items()
    }


def _is_array(value: object) -> bool:
    return bool(dr.is_jit_v(value)) and dr.depth_v(value) == 1


def _mark(value: Any) -> object:
    """The number of an array's variable, which a new value changes; others are text."""
    return value.index if _is_array(value) else value

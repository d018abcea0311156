"""Cameras out of files whose values are no camera's."""

from __future__ import annotations

from typing import Any

import pytest

from iriftrace.camera.camera import Camera
from iriftrace.core.errors import InputError

GOOD = Camera(focal_length_mm=20.0, sensor_mm=(6.0, 5.0), resolution=(12, 10)).as_dict()


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("focus_mm", None),
        ("focus_mm", "near"),
        ("sensor_mm", {"width": 1}),
        ("matrix", "none"),
        ("resolution", ["a", "b"]),
        ("focal_length_mm", "twenty"),
        ("distortion", {"k9": 1}),
    ],
)
def test_a_camera_that_is_none(key: str, value: Any) -> None:
    with pytest.raises(InputError):
        Camera.from_dict({**GOOD, key: value})


@pytest.mark.parametrize("values", ["camera", None, [], {}])
def test_no_values_at_all(values: Any) -> None:
    with pytest.raises(InputError, match="missing or misspelt"):
        Camera.from_dict(values)

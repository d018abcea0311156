"""Lenses that distort, and a camera for them."""

from __future__ import annotations

from iriftrace.camera.camera import Camera
from iriftrace.camera.distortion import Distortion
from validation.inputs.cameras import camera_at

LENSES = {
    "barrel": Distortion.of_sequence((-0.25, 0.1, 1e-3, -2e-3, -0.02)),
    "pincushion": Distortion.of_sequence((0.3, 0.1, 1e-3, 2e-3, 0.1)),
    "rational": Distortion.of_sequence((0.8, -0.3, 1e-3, -1e-3, 0.1, 0.9, -0.1, 0.02)),
    "tangential": Distortion.of_sequence((0.0, 0.0, 0.01, -0.02)),
}
"""Distortion of up to a tenth of the picture's width; good lenses have a hundredth of that."""


def lens_camera(lens: Distortion | None) -> Camera:
    """The paper's camera, principal point off the centre, with a lens."""
    return camera_at(
        (150.0, -100.0, 120.0),
        (3.0, -2.0, 1.0),
        sensor_mm=(6.7, 5.6),
        resolution=(2448, 2048),
        principal_point_px=(1209.5, 1030.5),
        distortion=lens,
    )

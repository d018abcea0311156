"""The figure of a correction: what its colours and bins mean."""

from __future__ import annotations

import numpy as np

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.figures.scan import correction_figure
from iriftrace.part.shapes.cylinder import cylinder
from iriftrace.triangulation.correction import Correction

CAMERA = Camera(
    focal_length_mm=10.0,
    sensor_mm=(6.7, 5.6),
    resolution=(612, 512),
    matrix=look_at((0.0, -300.0, 0.0), (0.0, 0.0, 0.0)),
)


def test_colours_are_the_removed_error_and_say_that_they_end() -> None:
    """A correction along the normal would have the other sign; points lie beyond one end."""
    part = cylinder()
    count = 1000
    rng = np.random.default_rng(2)
    normal = np.tile((0.0, -1.0, 0.0), (count, 1))
    along = -1e-3 * np.linspace(1.0, 2.0, count)
    along[:5] = -0.1
    measured = np.column_stack((rng.uniform(-20, 20, count), np.full(count, -13.5), along))
    face = np.full(count, int(np.argmin(part.surface.normals[:, 1])))
    found = Correction(
        measured=measured,
        error=along[:, None] * normal,
        status=np.zeros(count, dtype=np.int64),
        face=face,
        normal=normal,
        system="fringe",
        provenance={"field": {"source": "a solver"}},
    )
    (body,) = correction_figure(found, part, CAMERA).subfigs
    left, right, bar = body.axes
    assert left.collections[0].get_array().max() < 0.0
    assert bar.get_xlabel() == "error along the normal (µm)"
    assert left.collections[0].colorbar.extend == "min"
    assert "beyond" in right.get_xlabel()

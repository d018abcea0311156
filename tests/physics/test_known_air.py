"""Both engines against exact rays through air that a formula gives, and those rays against Bouguer.

The rays of the oracle are checked with the hot cylinder's closed form, the engines with the oracle.
"""

from pathlib import Path

import numpy as np
import pytest

from iriftrace.scenes.closed_forms import (
    AMBIENT_K,
    CYLINDER_UM,
    OUTER_MM,
    RADIUS_MM,
    REFRACTIVITY,
    WALL_K,
    around,
)
from validation.inputs.parts import cylinder_fine_at
from validation.line import beyond
from validation.oracles.curved_rays import displacements
from validation.sections.known_air import on_the_cylinder


def hot_cylinder(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """n - 1 and its gradient where temperature falls with the logarithm of the radius."""
    radius = np.hypot(points[:, 1], points[:, 2])
    n = around(radius)
    kelvin = REFRACTIVITY * AMBIENT_K / n
    fall = (WALL_K - AMBIENT_K) / np.log(OUTER_MM / RADIUS_MM) / radius
    slope = np.where(radius < OUTER_MM, n / kelvin * fall, 0.0)
    return n, np.column_stack((0 * n, points[:, 1:] * (slope / radius)[:, None]))


def test_rays_of_the_oracle_end_as_bouguer_says() -> None:
    heights = np.array(list(CYLINDER_UM)[:3])
    part = cylinder_fine_at(180.0 - np.degrees(np.arcsin(heights)), RADIUS_MM, 60.0)
    origin = np.column_stack((0 * heights + 0.123, 0 * heights - 100.0, heights * RADIUS_MM))
    direction = np.tile((0.0, 1.0, 0.0), (3, 1))
    found = displacements(part, hot_cylinder, origin, direction, 75.0, step_mm=0.01)
    sizes = 1e3 * np.linalg.norm(found, axis=1)
    np.testing.assert_allclose(sizes, list(CYLINDER_UM.values())[:3], rtol=3e-4)


@pytest.mark.slow
@pytest.mark.usefixtures("variant")
def test_engines_are_right_on_a_fine_mesh(tmp_path: Path) -> None:
    lines = on_the_cylinder(tmp_path)
    assert sum(line.bound is not None for line in lines) == 12
    assert beyond(lines) == []

"""The cells engine in media whose rays are known: order, energy, reversal, exact ends.

Luneburg lens, Maxwell fish-eye, linear and parabolic media have closed forms; other rays are
compared with SciPy's DOP853 at a tolerance of 1e-12, which shares no code with the engine.
"""

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
import trimesh
from scipy.integrate import solve_ivp

from iriftrace.scenes.analytic import WALL_K
from iriftrace.scenes.closed_forms import SLAB_SHIFT_UM
from validation.inputs.hot_air import REFRACTIVITY, cylinder_ends, slab_ends
from validation.inputs.small_scenes import part
from validation.inputs.smooth_medium import SmoothMedium, follow
from validation.line import beyond
from validation.oracles.media import (
    LUNEBURG_HEIGHT,
    Launch,
    end_error,
    launches,
    parabola,
    walk,
)
from validation.sections.exact_cells import CELLS_BOUND, FORMULA_BOUND, SECTION

AMBIENT_K = 293.15
SLOPE_PER_MM = 1e-3
LAUNCHES = launches()

pytestmark = pytest.mark.usefixtures("variant")


@pytest.mark.slow
def test_every_figure_of_the_accuracy_page_is_within_its_bound(tmp_path: Path) -> None:
    """Ends, orders, speeds and ways back in closed forms; slab and cylinder, also on cells."""
    lines = SECTION.compute(tmp_path)
    assert beyond(lines) == []
    bounds = [line.bound for line in lines]
    assert len(lines) == 4 * len(LAUNCHES) + 5 + 3 * 7
    assert None not in bounds
    assert bounds.count(FORMULA_BOUND) == 7
    assert bounds.count(CELLS_BOUND) == 14


def test_a_ray_led_wrong_leaves_the_bounds() -> None:
    """The figures see an error: of the step's length, of the start and of the medium."""
    lens = LAUNCHES["Luneburg lens"]
    late = Launch(lens.medium, lens.start, lens.velocity, lens.time * (1 + 1e-7), lens.end)
    assert end_error(late, 64) > 1e-8
    wrong = walk(lens.medium, lens.start, lens.velocity * (1 + 1e-8), lens.time, 64)
    assert wrong.drift > 1e-9


def test_luneburg_lens_errs_like_the_rule_computed_elsewhere() -> None:
    """5.75e-8 with 32 steps, 3.57e-9 with 64, 2.22e-10 with 128."""
    lens = LAUNCHES["Luneburg lens"]
    errors = [end_error(lens, n) for n in (32, 64, 128)]
    np.testing.assert_allclose(errors, (5.75e-8, 3.57e-9, 2.22e-10), rtol=0.02)
    heading = walk(lens.medium, lens.start, lens.velocity, lens.time, 64).velocity
    np.testing.assert_allclose(
        heading, (np.sqrt(1 - LUNEBURG_HEIGHT**2), -LUNEBURG_HEIGHT, 0), atol=1e-8
    )


@pytest.mark.parametrize("steps", [1, 7])
def test_linear_medium_bends_rays_to_parabolas(steps: int) -> None:
    """A constant acceleration is what every step integrates exactly, whatever its length."""
    ray = parabola(500)
    found = walk(ray.medium, ray.start, ray.velocity, ray.time, steps)
    np.testing.assert_allclose(found.end, ray.end, atol=1e-9)
    assert found.velocity_error < 1e-15


def linear_in_z(point: Any) -> tuple[Any, Any]:
    """n = 1 + k z."""
    return SLOPE_PER_MM * point.z, mi.Vector3d(0, 0, SLOPE_PER_MM)


def catenary(x: Any) -> Any:
    """Height of the ray that starts along x: z'' = k (1 + k z), x = t (r'' = n grad n)."""
    return (np.cosh(SLOPE_PER_MM * x) - 1) / SLOPE_PER_MM


@pytest.mark.parametrize("step", [0.5, 5.0])
def test_part_beside_the_straight_line_is_hit_on_the_curve(tmp_path: Path, step: float) -> None:
    """A ball of 0.6 mm that the ray's first straight line misses by 5 mm, on to a wall."""
    ball = trimesh.creation.icosphere(4, 0.3)
    ball.apply_translation((100, 0, catenary(100.0)))
    wall = trimesh.creation.box(bounds=((200, -50, -50), (201, 50, 50)))
    both = trimesh.util.concatenate([ball, wall])
    origins, directions = np.zeros((1, 3)), np.array([(1.0, 0.0, 0.0)])
    medium = SmoothMedium(linear_in_z, step)
    ends, straight = follow(part(tmp_path, both), medium, origins, directions)
    np.testing.assert_allclose(straight, [(200, 0, 0)], atol=1e-9)
    assert ends.outcome == [1]
    x, y, z = ends.point[0]
    np.testing.assert_allclose((y, z), (0, catenary(x)), atol=1e-7)
    assert x == pytest.approx(100 - 0.3 * np.cos(0.1), abs=1e-3)


def reference(ray: Launch, velocity: np.ndarray, time: float) -> np.ndarray:
    """End and velocity by SciPy."""

    def rate(_: float, state: np.ndarray) -> np.ndarray:
        return np.concatenate((state[3:], np.array(ray.medium(*state[:3])[1], dtype=float) / 2))

    return solve_ivp(
        rate, (0, time), np.concatenate((ray.start, velocity)), "DOP853", rtol=1e-13, atol=1e-15
    ).y[:, -1]


@pytest.mark.parametrize("name", LAUNCHES)
def test_ends_equal_those_of_an_independent_solver(name: str) -> None:
    ray = LAUNCHES[name]
    turned = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    length = np.linalg.norm(ray.velocity)
    velocity = turned @ ray.velocity * (length / np.linalg.norm(turned @ ray.velocity))
    found = walk(ray.medium, ray.start, velocity, 0.6 * ray.time, 1000)
    expected = reference(ray, velocity, 0.6 * ray.time)
    np.testing.assert_allclose(
        np.concatenate((found.end, found.velocity)), expected, rtol=1e-9, atol=1e-9
    )


def test_error_estimate_of_a_step_is_larger_than_its_error() -> None:
    lens = LAUNCHES["Luneburg lens"]
    for steps in (8, 32, 128):
        found = walk(lens.medium, lens.start, lens.velocity, lens.time, steps)
        assert np.linalg.norm(found.end - lens.end) < found.velocity_error * lens.time


def test_hot_cylinders_rays_end_in_the_walls_air(tmp_path: Path) -> None:
    """The index at the hits is the wall's; the displacements are figures of the page."""
    ends, _ = cylinder_ends(tmp_path)
    assert (ends.outcome == 1).all()
    np.testing.assert_allclose(
        ends.entry_index + ends.index_sum - 1, REFRACTIVITY * AMBIENT_K / WALL_K, rtol=1e-6
    )


def test_slab_bends_rays_in_their_plane_as_snell_demands(tmp_path: Path) -> None:
    """n sin(theta) is the same everywhere."""
    ends, straight = slab_ends(tmp_path)
    np.testing.assert_allclose((ends.point - straight)[:, 1:], 0, atol=1e-9)
    np.testing.assert_allclose(
        (ends.entry_index + ends.index_sum) * ends.direction[:, 0],
        (1 + REFRACTIVITY) * np.sin(np.radians(list(SLAB_SHIFT_UM))),
        rtol=1e-10,
    )

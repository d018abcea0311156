"""The continuous engine in media whose rays are known: order, energy, reversal, exact ends.

Luneburg lens, Maxwell fish-eye, linear and parabolic media have closed forms; other rays are
compared with SciPy's DOP853 at a tolerance of 1e-12, which shares no code with the engine.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from scipy.integrate import solve_ivp

from iriftrace.plugins.nystrom import nystrom_step
from iriftrace.scenes.analytic import CYLINDER_RADIUS_MM, HOT_AIR_RADIUS_MM, SLAB_MM, WALL_K
from tests.continuous_media import SmoothMedium, follow
from tests.small_scenes import part

AMBIENT_K, REFRACTIVITY = 293.15, 2.718e-4

CYLINDER_UM = {0.25: 0.484096, 0.75: 2.430121, 0.95: 7.621401, 0.999: 67.019772}
SLAB_SHIFT_UM = {15: 0.906732, 60: 21.891213, 85: 4921.029686}


def luneburg(x: Any, y: Any, z: Any) -> tuple[Any, tuple[Any, Any, Any]]:
    """n^2 = 2 - r^2."""
    return 2 - (x * x + y * y + z * z), (-2 * x, -2 * y, -2 * z)


def fish_eye(x: Any, y: Any, z: Any) -> tuple[Any, tuple[Any, Any, Any]]:
    """n = 2 / (1 + r^2)."""
    shape = 1 / (1 + x * x + y * y + z * z)
    slope = -16 * shape * shape * shape
    return 4 * shape * shape, (slope * x, slope * y, slope * z)


N0, SLOPE = 1.0002718, 2 * 1.0002718 * 1e-5


def linear(x: Any, y: Any, z: Any) -> tuple[Any, tuple[Any, Any, Any]]:
    """n^2 = n0^2 + a y, in the scale of air."""
    return N0**2 + SLOPE * y, (0 * x, 0 * y + SLOPE, 0 * z)


G = 0.1


def rod(x: Any, y: Any, z: Any) -> tuple[Any, tuple[Any, Any, Any]]:
    """n^2 = n0^2 (1 - g^2 y^2), a SELFOC rod."""
    return 2.25 * (1 - G * G * y * y), (0 * x, -4.5 * G * G * y, 0 * z)


Medium = Callable[[Any, Any, Any], tuple[Any, tuple[Any, Any, Any]]]

HEIGHT = 0.5
START = np.array((-np.sqrt(1 - HEIGHT**2), HEIGHT, 0.0))
# Medium, start, direction, length of the parameter, exact end.
CASES: dict[str, tuple[Medium, np.ndarray, np.ndarray, float, np.ndarray]] = {
    "luneburg": (
        *(luneburg, START, np.array((1.0, 0, 0)), np.pi / 2),
        np.array((1.0, 0.0, 0.0)),
    ),
    # From p to -p / |p|^2.
    "fish-eye": (
        *(fish_eye, np.array((-0.6, 0.2, 0.0)), np.array((0.6, 0.8, 0.0)), np.nan),
        np.array((1.5, -0.5, 0.0)),
    ),
    "rod": (
        *(rod, np.array((0.0, 2.0, 0.0)), np.array((1.0, 0.0, 0.0)), 100.0),
        np.array((1.5 * np.sqrt(1 - G**2 * 4) * 100, 2 * np.cos(1.5 * G * 100), 0.0)),
    ),
}


def speed(medium: Medium, point: np.ndarray) -> np.ndarray:
    return np.sqrt(medium(*point)[0])


def walk(
    medium: Medium, start: np.ndarray, velocity: np.ndarray, time: float, steps: int
) -> tuple[np.ndarray, np.ndarray, float]:
    """End, velocity and estimated error after equal steps of the engine's own rule."""
    import drjit as dr
    import mitsuba as mi

    def acceleration(point: Any) -> Any:
        return mi.Vector3d(*medium(point.x, point.y, point.z)[1]) / 2

    point, heading = mi.Point3d(*map(float, start)), mi.Vector3d(*map(float, velocity))
    doubt = 0.0
    for _ in range(steps):
        point, heading, more = nystrom_step(
            point, heading, acceleration, mi.Float64(float(time / steps))
        )
        point = mi.Point3d(point)
        dr.eval(point, heading, more)
        doubt += float(more[0])
    return np.array(point)[:, 0], np.array(heading)[:, 0], doubt


def reference(medium: Medium, start: np.ndarray, velocity: np.ndarray, time: float) -> np.ndarray:
    """The same end by SciPy."""

    def rate(_: float, state: np.ndarray) -> np.ndarray:
        return np.concatenate((state[3:], np.array(medium(*state[:3])[1], dtype=float) / 2))

    return solve_ivp(
        rate, (0, time), np.concatenate((start, velocity)), "DOP853", rtol=1e-13, atol=1e-15
    ).y[:, -1]


def launched(name: str) -> tuple[Medium, np.ndarray, np.ndarray, float, np.ndarray]:
    medium, start, direction, time, end = CASES[name]
    if name == "fish-eye":
        time = fish_eye_time(start, direction)
    return medium, start, direction * speed(medium, start), time, end


def fish_eye_time(start: np.ndarray, direction: np.ndarray) -> float:
    """Parameter from a point to its image.

    The fish-eye is the stereographic picture p = (2 r, r^2 - 1) / (1 + r^2) of a sphere on which
    n ds is the arc and n = 1 - p_z (p's last component). Rays are great circles, and dt = ds / n is
    integrated as d(arc) / n^2 over half of one.
    """
    squared = start @ start
    place = np.append(2 * start, squared - 1) / (1 + squared)
    # The projection's differential, applied to the direction; it keeps angles.
    slant = start @ direction
    along = np.append(2 * direction * (1 + squared) - 4 * start * slant, 4 * slant)
    along /= np.linalg.norm(along)
    arc, weight = np.polynomial.legendre.leggauss(200)
    arc, weight = (arc + 1) * np.pi / 2, weight * np.pi / 2
    height = np.cos(arc) * place[3] + np.sin(arc) * along[3]
    return float(weight @ (1 / (1 - height) ** 2))


@pytest.mark.usefixtures("variant")
@pytest.mark.parametrize("name", CASES)
def test_convergence_is_of_order_four(name: str) -> None:
    medium, start, velocity, time, end = launched(name)
    counts = np.array((16, 32, 64, 128))
    scale = 10 if name == "rod" else 1
    errors = [
        np.linalg.norm(walk(medium, start, velocity, time, scale * n)[0] - end) for n in counts
    ]
    slope = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
    assert slope >= 3.8


@pytest.mark.usefixtures("variant")
def test_luneburg_lens_focuses_within_1e_8_after_64_steps() -> None:
    """And the errors are those of the order-4 rule computed elsewhere: 5.75e-8, then 3.57e-9."""
    medium, start, velocity, time, end = launched("luneburg")
    errors = [
        np.linalg.norm(walk(medium, start, velocity, time, n)[0] - end) for n in (32, 64, 128)
    ]
    np.testing.assert_allclose(errors, (5.75e-8, 3.57e-9, 2.22e-10), rtol=0.02)
    heading = walk(medium, start, velocity, time, 64)[1]
    np.testing.assert_allclose(heading, (np.sqrt(1 - HEIGHT**2), -HEIGHT, 0), atol=1e-8)


@pytest.mark.usefixtures("variant")
@pytest.mark.parametrize(("x", "y_um"), [(100, 49.986414), (200, 199.945655), (500, 1249.660342)])
def test_linear_medium_bends_rays_to_parabolas(x: float, y_um: float) -> None:
    """A constant acceleration is what every step integrates exactly, whatever its length."""
    for steps in (1, 7):
        end, _, doubt = walk(linear, np.zeros(3), np.array((N0, 0, 0)), x / N0, steps)
        np.testing.assert_allclose(end, (x, y_um / 1e3, 0), atol=1e-9)
        assert doubt < 1e-15


@pytest.mark.usefixtures("variant")
@pytest.mark.parametrize("name", CASES)
def test_speed_is_the_index_and_the_way_back_leads_home(name: str) -> None:
    medium, start, velocity, time, _ = launched(name)
    steps = 2000
    end, heading, _ = walk(medium, start, velocity, time, steps)
    assert np.linalg.norm(heading) == pytest.approx(speed(medium, end), rel=1e-9)
    home, back, _ = walk(medium, end, -heading, time, steps)
    np.testing.assert_allclose(home, start, atol=1e-9)
    np.testing.assert_allclose(back, -velocity, atol=1e-9)


@pytest.mark.usefixtures("variant")
@pytest.mark.parametrize("name", CASES)
def test_ends_equal_those_of_an_independent_solver(name: str) -> None:
    medium, start, velocity, time, _ = launched(name)
    turned = np.array([[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]])
    length = np.linalg.norm(velocity)
    velocity = turned @ velocity * (length / np.linalg.norm(turned @ velocity))
    end, heading, _ = walk(medium, start, velocity, 0.6 * time, 1000)
    expected = reference(medium, start, velocity, 0.6 * time)
    np.testing.assert_allclose(np.concatenate((end, heading)), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.usefixtures("variant")
def test_doubt_of_a_step_is_larger_than_its_error() -> None:
    medium, start, velocity, time, end = launched("luneburg")
    for steps in (8, 32, 128):
        found, _, doubt = walk(medium, start, velocity, time, steps)
        assert np.linalg.norm(found - end) < doubt * time


def hot_cylinder(point: Any) -> tuple[Any, Any]:
    """Temperature linear in ln r between the wall and 60 mm, n - 1 in proportion to 1 / T."""
    import drjit as dr
    import mitsuba as mi

    squared = point.y * point.y + point.z * point.z
    slope = -(WALL_K - AMBIENT_K) / math.log(HOT_AIR_RADIUS_MM / CYLINDER_RADIUS_MM)
    warm = squared < HOT_AIR_RADIUS_MM**2
    temperature = WALL_K + slope * dr.log(squared / CYLINDER_RADIUS_MM**2) / 2
    temperature = dr.select(warm, temperature, AMBIENT_K)
    refractivity = REFRACTIVITY * AMBIENT_K / temperature
    steep = dr.select(warm, -refractivity / temperature * slope / squared, 0)
    return refractivity, mi.Vector3d(0 * steep, steep * point.y, steep * point.z)


def to_the_edge_of_the_hot_cylinder(point: Any, direction: Any) -> Any:
    import drjit as dr

    squared = direction.y**2 + direction.z**2
    along = point.y * direction.y + point.z * direction.z
    outside = point.y**2 + point.z**2 - HOT_AIR_RADIUS_MM**2
    return (-along - dr.sqrt(dr.maximum(along**2 - squared * outside, 0))) / squared


@pytest.mark.usefixtures("variant")
def test_hot_cylinder_displaces_hits_as_the_quadrature_says(tmp_path: Path) -> None:
    """Within 0.01 %; the part's 40,000 facets are rounded to single precision, which costs 0.01 um
    where the ray grazes them.
    """
    solid = trimesh.creation.cylinder(CYLINDER_RADIUS_MM, 60.0, sections=40_000)
    solid.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
    heights = np.array(list(CYLINDER_UM)) * CYLINDER_RADIUS_MM
    origins = np.column_stack((np.full(4, 0.123), np.full(4, -70.0), heights))
    ends, straight = follow(
        part(tmp_path, solid),
        SmoothMedium(hot_cylinder, 0.02, kink=to_the_edge_of_the_hot_cylinder),
        origins,
        np.tile((0.0, 1.0, 0.0), (4, 1)),
    )
    assert (ends.outcome == 1).all()
    found_um = np.linalg.norm(ends.point - straight, axis=1) * 1e3
    np.testing.assert_allclose(found_um, list(CYLINDER_UM.values()), rtol=1e-4)
    np.testing.assert_allclose(
        ends.entry_index + ends.index_sum - 1, REFRACTIVITY * AMBIENT_K / WALL_K, rtol=1e-6
    )


def slab_air(point: Any) -> tuple[Any, Any]:
    """Temperature linear in z between the plate at 0 and 20 mm above."""
    import drjit as dr
    import mitsuba as mi

    slope = (AMBIENT_K - WALL_K) / SLAB_MM
    warm = point.z < SLAB_MM
    temperature = dr.select(warm, WALL_K + slope * point.z, AMBIENT_K)
    refractivity = REFRACTIVITY * AMBIENT_K / temperature
    steep = dr.select(warm, -refractivity / temperature * slope, 0)
    return refractivity, mi.Vector3d(0 * steep, 0 * steep, steep)


def to_the_top_of_the_slab(point: Any, direction: Any) -> Any:
    return (SLAB_MM - point.z) / direction.z


@pytest.mark.usefixtures("variant")
def test_slab_shifts_rays_as_snell_demands(tmp_path: Path) -> None:
    box = trimesh.creation.box((1000.0, 1000.0, 5.0))
    box.apply_translation((0, 0, -2.5))
    angles = np.radians(list(SLAB_SHIFT_UM))
    directions = np.column_stack((np.sin(angles), 0 * angles, -np.cos(angles)))
    origins = np.array((1.0, 2.0, 0.0)) - directions * (21 / np.cos(angles))[:, None]
    ends, straight = follow(
        part(tmp_path, box),
        SmoothMedium(slab_air, 0.02, kink=to_the_top_of_the_slab),
        origins,
        directions,
    )
    shift_um = (ends.point - straight) * 1e3
    np.testing.assert_allclose(shift_um[:, 0], list(SLAB_SHIFT_UM.values()), rtol=1e-4)
    np.testing.assert_allclose(shift_um[:, 1:], 0, atol=1e-6)
    # n sin(theta) is the same everywhere.
    np.testing.assert_allclose(
        (ends.entry_index + ends.index_sum) * ends.direction[:, 0],
        (1 + REFRACTIVITY) * np.sin(angles),
        rtol=1e-10,
    )

"""Rays through a medium of the user's own: the Luneburg lens, whose focus is known."""

from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
import trimesh

import iriftrace
from iriftrace.core.errors import InputError
from validation.inputs.small_scenes import camera, film, part, scene

pytestmark = pytest.mark.usefixtures("variant")

RADIUS, BOX = 10.0, 12.0  # mm


class Luneburg:
    """n = sqrt(2 - r^2 / R^2) in a ball, 1 around it (Luneburg, Mathematical Theory of Optics)."""

    def __init__(self, contrast: Any = 1.0) -> None:
        self.contrast = contrast

    def index(self, point: Any) -> Any:
        depth = dr.maximum(1 - dr.squared_norm(point) / RADIUS**2, 0)
        return dr.sqrt(1 + self.contrast * depth)

    def gradient(self, point: Any) -> Any:
        inside = dr.squared_norm(point) < RADIUS**2
        return dr.select(inside, -self.contrast * point / (RADIUS**2 * self.index(point)), 0)

    def extent(self) -> tuple[list[float], list[float]]:
        return [-BOX] * 3, [BOX] * 3


def lens(folder: Path, step: float, medium: Any = None, **more: Any) -> Any:
    """A lens before a wall that touches it at the pole (0, R, 0)."""
    wall = trimesh.creation.box((60.0, 1.0, 60.0))
    wall.apply_translation((0.0, RADIUS + 0.5, 0.0))
    integrator = mi.load_dict({"type": "gradient_path", **more})
    integrator.march(medium or Luneburg(), step)
    sensor = camera(film=film(12, 10), origin=(0.0, -40.0, 0.0))
    return scene({"part": part(folder, wall), "integrator": integrator}, sensor)


def parallel(offsets: list[tuple[float, float]], start: float = -30.0) -> tuple[Any, Any]:
    x, z = np.array(offsets).T
    return mi.Point3d(x, np.full(len(x), start), z), mi.Vector3d(0, 1, 0)


OFFSETS = [(0.0, 0.0), (3.0, 0.0), (-4.0, 4.0), (0.0, 7.0), (6.0, -6.0), (8.9, 0.0)]


def aside(hits: Any) -> np.ndarray:
    """Distances of the hits from the pole, mm."""
    assert np.array(hits.status).tolist() == [0] * len(OFFSETS)
    assert np.array(hits.refracted.y) == pytest.approx(RADIUS, abs=1e-6)
    return np.hypot(np.array(hits.refracted.x), np.array(hits.refracted.z))


def test_parallel_rays_meet_at_the_opposite_pole(tmp_path: Path) -> None:
    """To order 2: the error of order 1 of the step into the ball, where the gradient jumps, shifts
    the ray along itself at the pole."""
    coarse, fine = (
        aside(iriftrace.hits(lens(tmp_path, step), parallel(OFFSETS))) for step in (0.04, 0.01)
    )
    assert coarse.max() < 5e-6
    assert fine[1:] == pytest.approx(coarse[1:] / 16, rel=0.05)


@pytest.mark.parametrize("start", [-11.0, -10.1])
def test_rays_may_start_in_the_box(tmp_path: Path, start: float) -> None:
    assert aside(iriftrace.hits(lens(tmp_path, 0.04), parallel(OFFSETS, start))).max() < 1e-5


def test_a_picture_shows_the_pole_magnified(tmp_path: Path) -> None:
    """A paraxial ray from distance a before a ball lens of focal length R, whose back is its focus.

    It enters at height h with slope h / (a - R) and meets the pole's plane at R times that slope.
    """
    loaded = lens(tmp_path, 0.04)
    pixels = np.array(mi.render(loaded))
    names = [one.name for one in loaded.sensors()[0].film().bitmap().struct_()]
    channel = dict(zip(names, np.moveaxis(pixels, 2, 0), strict=True))
    near = np.unravel_index(
        np.argmin(np.hypot(channel["straight.X"], channel["straight.Z"])), pixels.shape[:2]
    )
    slope = channel["straight.X"][near] / (40.0 + RADIUS)
    assert channel["status.code"][near] == 0
    assert channel["refracted.X"][near] == pytest.approx(RADIUS * slope, rel=0.02)


def test_derivatives_by_a_parameter_of_the_medium(tmp_path: Path) -> None:
    """Reverse mode and central differences."""

    def mean(contrast: Any) -> Any:
        found = iriftrace.hits(
            lens(tmp_path, 0.1, Luneburg(contrast), max_steps=2000), parallel(OFFSETS)
        )
        return dr.mean(found.refracted.x)

    contrast = mi.Float64(0.7)
    dr.enable_grad(contrast)
    dr.backward(mean(contrast))
    ends = [float(mean(mi.Float64(0.7 + change))[0]) for change in (1e-4, -1e-4)]
    assert float(dr.grad(contrast)[0]) == pytest.approx((ends[0] - ends[1]) / 2e-4, rel=1e-4)


def test_results_do_not_state_a_medium_of_ones_own(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"use mi\.render or iriftrace\.hits") as caught:
        iriftrace.from_mitsuba(lens(tmp_path, 0.1))
    assert caught.value.code == "medium.own"


@pytest.mark.parametrize("step", [0.0, -1.0, float("nan")])
def test_a_step_is_positive(step: float) -> None:
    with pytest.raises(InputError, match=r"in steps of"):
        mi.load_dict({"type": "gradient_path"}).march(Luneburg(), step)

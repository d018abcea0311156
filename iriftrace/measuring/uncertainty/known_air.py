r"""Error of both engines on a mesh, in air that is known at every point.

A formula's temperatures are put on the points of the mesh, which is all that the engines see of it,
and their rays are compared with rays led through the formula itself by Runge and Kutta's rule in
double precision. With the unit direction u and the length s the ray equation is
:math:`d\mathbf{u}/ds = (\nabla n - (\nabla n \cdot \mathbf{u})\,\mathbf{u}) / n`. Air outside the
data of a field bends nothing, as for both engines.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from attrs import evolve, frozen
from numpy.typing import ArrayLike

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.engines import Engine
from iriftrace.core.errors import InputError, without_warnings
from iriftrace.core.plain import JsonObject, plain
from iriftrace.image.aov_image import Status
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.index_field import IndexField
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.scene import Scene, ready_scene

Known = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Values (k,), of T, K, or n - 1, and their gradients (k, 3), 1/mm, at points (k, 3), mm."""

Hits = Callable[[FloatArray, FloatArray], FloatArray]
"""Distances to the part along straight rays (k, 3), mm; inf where they miss it."""

STEP_MM = 0.5
"""A fifteenth of a boundary layer: the rule's error is 2e-5 of the displacement, measured."""

MARGINS_MM = 2.0, 0.02
"""Rays are led so far from the part, then to here, from where they are straight: on 0.02 mm the air
bends them by 1e-8 mm."""

RAYS = 1000
"""Number of pixels that are compared; as many as a quarter are added at silhouettes."""

CANDIDATES = 20
"""Pixels from which each is chosen, as a part may fill little of the picture."""

FEWEST = 20
"""Minimum number of pixels of a class for a 95th percentile."""

NEIGHBOUR_PX = 2.0
STEEPEST = 5.0
"""A pixel is at a silhouette if a line of sight at `NEIGHBOUR_PX` misses the part or is longer or
shorter by over `STEEPEST` times the distance between both (79 degrees from the normal)."""


@frozen
class EngineDeviation:
    """Error of one engine's displacements in one class of pixels.

    Attributes
    ----------
    engine, pixels : str
        ``"shells"`` or ``"cells"``; ``"inside"`` or ``"silhouettes"``.
    rays : int
    displacement_median_mm, displacement_p95_mm : float, mm
        Exact ones.
    median, p95 : float
        Quantiles of the differences from the exact displacements, as fractions of these.
    """

    engine: str
    pixels: str
    rays: int
    displacement_median_mm: float
    displacement_p95_mm: float
    median: float
    p95: float


@frozen(eq=False)
class KnownAir:
    """Errors by class of pixels and engine, and the number of shells."""

    layers: int
    errors: tuple[EngineDeviation, ...]

    @property
    def numerics(self) -> dict[str, float]:
        """Relative error by engine, for `Inputs.numerics`: the median inside silhouettes."""
        return {one.engine: one.median for one in self.errors if one.pixels == "inside"}

    def as_dict(self) -> JsonObject:
        """Plain JSON values."""
        return {"layers": self.layers, "numerics": self.numerics, "errors": plain(self.errors)}


def known_air(
    scene: Scene,
    field: IndexField,
    temperature: Known,
    *,
    layers: int = 13,
    rays: int = RAYS,
    step_mm: float = STEP_MM,
) -> KnownAir:
    """Trace a formula's air on the mesh of a field by both engines, and exactly.

    Parameters
    ----------
    scene : Scene
        Its part, blockers and camera are used, not its air.
    field : IndexField
        Its mesh and its ambient air are used.
    temperature : callable
        Temperatures (k,), K, and their gradients (k, 3), K/mm, at points (k, 3), mm, such as
        ``synthetic_air(part).at``.
    layers : int
        Number of shells.
    rays : int
        Number of pixels.
    step_mm : float, mm
        Step of the exact rays.

    Raises
    ------
    InputError
        Field and part do not overlap, or the camera sees too little of the part through hot air.
    """
    loaded = ready_scene(scene)
    camera = loaded.camera
    points = np.asarray(field.grid.points, dtype=np.float64)
    known = evolve(field, refractivity=field.air.refractivity(temperature(points)[0]))
    with without_warnings():
        air = HotAir(known, layers=layers)
        of_shells = Scene(
            loaded.part,
            air,
            camera,
            engine=Engine.SHELLS,
            variant=loaded.variant,
            blockers=loaded.blockers,
        ).ready
        scenes = {"shells": of_shells, "cells": of_shells.with_cells()}

    def hits(origin: FloatArray, direction: FloatArray) -> FloatArray:
        return _lengths(of_shells, origin, direction)

    low, high = camera.corners[[0, 2]]
    places = low + np.random.default_rng(1).random((CANDIDATES * rays, 2)) * (high - low)
    places = places[np.isfinite(hits(*camera.rays(places)))]
    edge = _at_silhouette(camera, places, hits) if len(places) else np.zeros(0, dtype=bool)
    bounds = np.reshape(field.grid.bounds, (3, 2)).T
    medium = index_of(temperature, field.air, bounds)
    found: list[EngineDeviation] = []
    for name, chosen, count in (("inside", ~edge, rays), ("silhouettes", edge, rays // 4)):
        origin, direction = camera.rays(places[chosen][: 2 * count])
        if len(origin):
            enters = _entrance(bounds, origin, direction)
            found += _errors(name, scenes, medium, hits, origin, direction, enters, count, step_mm)
    if not any(one.pixels == "inside" for one in found):
        raise InputError(
            f"The camera sees the part through hot air in fewer than {FEWEST} of "
            f"{CANDIDATES * rays} places of its picture, too few to compare; point it at the part.",
            code="picture.no_hit",
        )
    return KnownAir(layers, tuple(found))


def _errors(
    pixels: str,
    scenes: dict[str, Scene],
    medium: Known,
    hits: Hits,
    origin: FloatArray,
    direction: FloatArray,
    enters: FloatArray,
    count: int,
    step_mm: float,
) -> list[EngineDeviation]:
    """Errors of at most `count` rays that are good by both engines and hit the part exactly."""
    traced = {name: trace_rays(scene, origin, direction) for name, scene in scenes.items()}
    good = np.all([one.status == Status.GOOD for one in traced.values()], axis=0)
    chosen = np.flatnonzero(good)[:count]
    length = np.linalg.norm(traced["shells"].straight[chosen] - origin[chosen], axis=1)
    way = length - np.minimum(enters[chosen], length)
    exact = displacements(hits, medium, origin[chosen], direction[chosen], way, step_mm)
    size = np.linalg.norm(exact, axis=1)
    bent = size > 0.0  # neither NaN nor outside the hot air
    if bent.sum() < FEWEST:
        return []
    usual, large = np.quantile(size[bent], (0.5, 0.95)).tolist()
    found = []
    for name, one in traced.items():
        off = np.linalg.norm(one.displacement[chosen][bent] - exact[bent], axis=1)
        median, p95 = np.quantile(off, (0.5, 0.95)).tolist()
        numbers = (int(bent.sum()), usual, large, median / usual, p95 / large)
        found.append(EngineDeviation(name, pixels, *numbers))
    return found


def _lengths(scene: Scene, origin: FloatArray, direction: FloatArray) -> FloatArray:
    """Lengths (k,), mm, of straight rays to the part; inf where they miss it."""
    traced = trace_rays(scene, origin, direction)
    length = np.full(len(origin), np.inf)
    met = np.isfinite(traced.straight[:, 0])
    ends = traced.straight[met] - origin[traced.ray[met]]
    length[traced.ray[met]] = np.linalg.norm(ends, axis=1)
    return length


def _entrance(bounds: FloatArray, origin: FloatArray, direction: FloatArray) -> FloatArray:
    """Lengths (k,), mm, at which rays enter a box, (2, 3), mm; inf where they miss it."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (bounds[:, None] - origin) / direction
    first = np.nanmax(ends.min(axis=0), axis=1).clip(0.0)
    return np.where(first <= np.nanmin(ends.max(axis=0), axis=1), first, np.inf)


def _at_silhouette(camera: Camera, places: FloatArray, hits: Hits) -> BoolArray:
    """Mask (n,) of places in the picture (n, 2), px, next to which the part ends or recedes."""
    origin, direction = camera.rays(places)
    length = hits(origin, direction)
    edge = np.zeros(len(places), dtype=bool)
    for step in (
        (NEIGHBOUR_PX, 0.0),
        (-NEIGHBOUR_PX, 0.0),
        (0.0, NEIGHBOUR_PX),
        (0.0, -NEIGHBOUR_PX),
    ):
        other, towards = camera.rays(places + step)
        beside = hits(other, towards)
        gap = np.linalg.norm(other - origin + length[:, None] * (towards - direction), axis=1)
        edge |= ~(np.abs(beside - length) < STEEPEST * gap)
    return edge


def index_of(temperature: Known, light: Air, bounds: FloatArray) -> Known:
    """The index of air whose temperature is known, within bounds, (2, 3), mm.

    n - 1 falls with 1 / T. Outside the bounds nothing is bent.
    """

    def at(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        refractivity = np.full(len(points), light.ambient_refractivity)
        gradient = np.zeros((len(points), 3))
        within = ((points >= bounds[0]) & (points <= bounds[1])).all(axis=1)
        if within.any():
            kelvin, slope = temperature(points[within])
            refractivity[within] = light.refractivity(kelvin)
            gradient[within] = (-refractivity[within] / kelvin)[:, None] * slope
        return refractivity, gradient

    return at


def displacements(
    hits: Hits,
    medium: Known,
    origin: FloatArray,
    direction: FloatArray,
    way_mm: ArrayLike,
    step_mm: float = STEP_MM,
) -> FloatArray:
    """Refracted minus straight hit, (r, 3), mm; NaN where one of both rays misses.

    Parameters
    ----------
    hits : callable
    medium : callable
        n - 1 and its gradient.
    origin, direction : (r, 3) arrays, mm and unit vectors
    way_mm : float or (r,) array, mm
        Length of the paths before the part on which there is hot air.
    step_mm : float
        Where the gradient jumps, its error is that of one step there.
    """
    length = hits(origin, direction)
    met = np.isfinite(length)
    whole = np.broadcast_to(np.asarray(way_mm, dtype=np.float64), length.shape)[met]
    straight = (origin + np.where(met, length, 0.0)[:, None] * direction)[met]
    place, heading = straight - whole[:, None] * direction[met], direction[met]
    left = whole
    for margin in MARGINS_MM:
        led = np.nan_to_num(np.maximum(left - margin, 0.0))
        place, heading = _led(medium, place, heading, led, step_mm)
        left = hits(place, heading)
        # A ray that passes the edge it met straight may hit what lies far behind.
        left = np.where(left < whole, left, np.nan)
    found = np.full_like(origin, np.nan)
    found[met] = place + left[:, None] * heading - straight
    return found


def _led(
    medium: Known, place: FloatArray, heading: FloatArray, length: FloatArray, step_mm: float
) -> tuple[FloatArray, FloatArray]:
    """Rays led on by lengths (r,), mm, each in as many equal steps: places and directions."""

    def rate(point: FloatArray, along: FloatArray) -> FloatArray:
        refractivity, gradient = medium(point)
        across = gradient - (gradient * along).sum(axis=1)[:, None] * along
        return np.asarray(across / (1.0 + refractivity)[:, None])

    steps = int(np.ceil(length.max(initial=0.0) / step_mm))
    h = (length / max(steps, 1))[:, None]
    for _ in range(steps):
        k1 = rate(place, heading)
        k2 = rate(place + h / 2 * heading, heading + h / 2 * k1)
        k3 = rate(place + h / 2 * heading + h * h / 4 * k1, heading + h / 2 * k2)
        k4 = rate(place + h * heading + h * h / 2 * k2, heading + h * k3)
        place = place + h * heading + h * h / 6 * (k1 + k2 + k3)
        heading = heading + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        heading = heading / np.linalg.norm(heading, axis=1)[:, None]
    return place, heading

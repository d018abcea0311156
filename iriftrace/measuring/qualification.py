"""Scenarios whose answer is known, by which any program that traces rays through hot air is judged.

A kit is a folder with a folder for each scenario: ``scenario.json`` (rays, air, truth, bound),
``part.ply`` and ``field.vtu``. A tracer answers with one file of vectors for all of them. The model
is the qualification of simulators of X-ray tomography (VDI/VDE 2630, part 2.2).
"""

from __future__ import annotations

import math
import os
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from attrs import evolve, frozen
from numpy.typing import ArrayLike

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.core.arrays import FloatArray, Triple, as_float64
from iriftrace.core.engines import Engine
from iriftrace.core.errors import InputError, without_warnings
from iriftrace.core.files import write_json
from iriftrace.core.plain import JsonObject, plain
from iriftrace.image.aov_image import Status
from iriftrace.io.field import read_field
from iriftrace.io.json_files import read_json
from iriftrace.io.part_files import read_part, save_part
from iriftrace.io.reading import ReadField, ReadPart
from iriftrace.io.vtk_write import write_vtk
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.index_field import IndexField
from iriftrace.part.part import Part
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.scene import Scene

SCENARIO_SCHEMA, RESULTS_SCHEMA = "iriftrace.scenario/1", "iriftrace.qualification/1"
STATEMENT, PART, FIELD = "scenario.json", "part.ply", "field.vtu"

_REMEDY = "see an example in a kit"

_VIEW_MM = 10.0
"""Width of what a device sees at the part."""


def vectors(values: ArrayLike) -> tuple[Triple, ...]:
    """Rows of an (n, 3) array."""
    return tuple(
        (float(x), float(y), float(z)) for x, y, z in np.reshape(as_float64(values), (-1, 3))
    )


@frozen
class StatedAir:
    """Air of a scenario: n - 1 = `refractivity` `temperature_k` / T."""

    refractivity: float
    temperature_k: float

    @property
    def air(self) -> Air:
        """Air of this refractivity at 633 nm, by its pressure."""
        air = Air(temperature_k=self.temperature_k)
        for _ in range(4):
            ratio = self.refractivity / air.ambient_refractivity
            air = evolve(air, pressure_pa=air.pressure_pa * ratio)
        return air


@frozen
class Statement:
    """What ``scenario.json`` states.

    Attributes
    ----------
    title, text, formula : str
        The formula is that of the temperature, for tracers that need no mesh.
    air : StatedAir
    origin_mm, direction : tuples of n points, mm, and n unit vectors, world
        Rays, straight as far as the hot air.
    second_mm : tuple of points, mm, world, or None
        Second devices, one a ray, each of which sees the point where the ray ends; None for rays of
        one device.
    truth_mm : tuple of n vectors, mm, world
        End of the refracted ray minus that of the straight one. Of two devices: the point midway
        between their straight lines of sight minus the point where the ray ends.
    bound : float
        Largest error, as a fraction of the truth's length.
    judged : str
        ``"each"``: every ray must be within the bound. ``"median"``: the median of the errors over
        that of the truths, for what the mesh decides.
    """

    title: str
    text: str
    formula: str
    air: StatedAir
    origin_mm: tuple[Triple, ...]
    direction: tuple[Triple, ...]
    truth_mm: tuple[Triple, ...]
    bound: float
    judged: str = "each"
    second_mm: tuple[Triple, ...] | None = None
    schema: str = SCENARIO_SCHEMA


@frozen(eq=False)
class Scenario:
    """A scenario with its part, mm, world, and the temperatures of its air on a mesh."""

    name: str  # of its folder
    stated: Statement
    part: Part
    field: IndexField


@frozen
class ScenarioVerdict:
    """Judgement of a tracer by one scenario; an error of None means that a ray has no answer."""

    scenario: str
    title: str
    rays: int
    error: float | None
    bound: float

    @property
    def passes(self) -> bool:
        """True for answers to every ray within the bound."""
        return self.error is not None and self.error <= self.bound

    def as_dict(self) -> JsonObject:
        """Plain JSON values."""
        return {**plain(self), "passes": self.passes}


def write_kit(path: Path, scenarios: Sequence[Scenario]) -> None:
    """Write a folder for each scenario into a new folder, which is there when all are written."""
    made = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        for one in scenarios:
            home = made / one.name
            home.mkdir(parents=True)
            save_part(one.part, home / PART)
            grid = one.field.grid.copy()
            grid.clear_data()
            grid.point_data["T"] = one.field.temperature_k
            write_vtk(home / FIELD, grid)
            write_json(home / STATEMENT, plain(one.stated))
        made.rename(path)
    finally:
        shutil.rmtree(made, ignore_errors=True)


def read_kit(path: Path) -> list[Scenario]:
    """Scenarios of a folder, in the order of their names; InputError for none or a damaged one."""
    found = [_scenario(file) for file in sorted(path.glob(f"*/{STATEMENT}"))]
    if not found:
        raise InputError(
            f"{path} has no scenario, which is a folder with a {STATEMENT}; name the folder of a "
            "kit, or one that does not exist, into which the kit is written.",
            code="scenario.none",
        )
    return found


def _scenario(path: Path) -> Scenario:
    stated = read_json(path, Statement, SCENARIO_SCHEMA, _REMEDY)
    lists = (stated.direction, stated.truth_mm, stated.second_mm or stated.origin_mm)
    if not stated.origin_mm or any(len(rows) != len(stated.origin_mm) for rows in lists):
        raise InputError(
            f"{path} has {len(stated.origin_mm)} rays, and other numbers of directions, truths or "
            "second devices; give one of each for every ray.",
            code="scenario.ray_count",
        )
    if stated.judged not in ("each", "median"):
        raise InputError(
            f'{path} is judged by "{stated.judged}"; write "each" or "median".',
            code="scenario.unknown_name",
        )
    air = read_field(
        path.with_name(FIELD),
        ReadField(array="T", temperature_unit="K", length_unit="mm"),
        air=stated.air.air,
    )
    return Scenario(
        path.parent.name, stated, read_part(path.with_name(PART), ReadPart(length_unit="mm")), air
    )


@frozen
class Results:
    """Answers of a tracer: vectors, mm, world, by the scenario's name; null for a lost ray."""

    tracer: str
    vectors_mm: dict[str, tuple[Triple | None, ...]]
    schema: str = RESULTS_SCHEMA


def read_results(path: Path) -> Results:
    """Answers of a tracer from its file; InputError if it is none."""
    return read_json(path, Results, RESULTS_SCHEMA, _REMEDY)


def traced_kit(scenarios: Sequence[Scenario], engine: Engine) -> Results:
    """Answers of this program, by one engine."""
    with without_warnings():
        found = {one.name: _traced(one, engine) for one in scenarios}
    return Results(f"iriftrace, {engine}", found)


def _traced(scenario: Scenario, engine: Engine) -> tuple[Triple | None, ...]:
    stated = scenario.stated
    origin, direction = np.array(stated.origin_mm), np.array(stated.direction)
    camera = _device(origin[0], origin[0] + direction[0])
    scene = Scene(scenario.part, HotAir(scenario.field), camera, engine=engine)
    hits = trace_rays(scene, origin, direction)
    good = hits.status == Status.GOOD
    if stated.second_mm is None:
        return tuple(
            row if kept else None
            for row, kept in zip(vectors(hits.displacement), good.tolist(), strict=True)
        )
    found: list[Triple | None] = []
    for first, second, target, kept in zip(
        origin, np.array(stated.second_mm), hits.straight, good.tolist(), strict=True
    ):
        devices = _device(first, target), _device(second, target)
        found.append(_pair_error(scene, *devices) if kept else None)
    return tuple(found)


def _pair_error(scene: Scene, first: Camera, second: Camera) -> Triple | None:
    """Error of the point at which two devices look; None where they see nothing in common."""
    try:
        (error,) = vectors(measure(scene, first, second, system="stereo").error)
    except InputError as reason:
        if reason.code != "devices.nothing_common":
            raise
        return None
    return error


def _device(origin: FloatArray, target: FloatArray) -> Camera:
    """A camera of one pixel that looks at a point and sees `_VIEW_MM` around it."""
    upwards = np.eye(3)[np.argmin(np.abs(target - origin))]
    return Camera(
        focal_length_mm=math.dist(origin, target),
        sensor_mm=(_VIEW_MM, _VIEW_MM),
        resolution=(1, 1),
        matrix=look_at(origin, target, upwards),
    )


def judge(
    scenarios: Sequence[Scenario], answers: Mapping[str, Sequence[Triple | None]]
) -> list[ScenarioVerdict]:
    """Judge vectors, mm, by scenario; a scenario without an answer is not passed.

    Raises
    ------
    InputError
        Answers to no scenario of the kit, or not one for each ray.
    """
    if other := sorted(set(answers) - {one.name for one in scenarios}):
        raise InputError(
            f"The kit has no scenario {', '.join(other)}; answer those that it has.",
            code="scenario.unknown_name",
        )
    return [_judged(one, answers.get(one.name)) for one in scenarios]


def _judged(scenario: Scenario, answer: Sequence[Triple | None] | None) -> ScenarioVerdict:
    stated = scenario.stated
    truth = np.array(stated.truth_mm)
    if answer is not None and len(answer) != len(truth):
        raise InputError(
            f"There are {len(answer)} answers to the {len(truth)} rays of {scenario.name}; give "
            "one for each, null for a lost one.",
            code="scenario.ray_count",
        )
    error = None
    if answer is not None and None not in answer:
        off = np.linalg.norm(np.array(answer) - truth, axis=1)
        size = np.linalg.norm(truth, axis=1)
        each = stated.judged == "each"
        error = float((off / size).max() if each else np.median(off) / np.median(size))
    return ScenarioVerdict(scenario.name, stated.title, len(truth), error, stated.bound)

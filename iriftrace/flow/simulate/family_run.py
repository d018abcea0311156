"""Run of a family: mesh once, solve members, make the others from them.

Each member starts with its draught everywhere. Started from the state of a neighbour 0.02 m/s
slower it became steady later (cylinder, 0.06 m/s): air outside the plume accelerates slowly.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

import pyvista as pv
from attrs import evolve, frozen

from iriftrace.core.errors import InputError, without_warnings
from iriftrace.core.files import write_whole
from iriftrace.core.plain import JsonObject
from iriftrace.flow.between import write_field_between
from iriftrace.flow.simulate.case import Case, read_record
from iriftrace.flow.simulate.family import FamilyMember
from iriftrace.flow.simulate.mesh import make_mesh
from iriftrace.flow.simulate.part_surface import reflected_grid
from iriftrace.flow.simulate.programs import Installation, find_openfoam
from iriftrace.flow.simulate.run import Cost, cost_of, expected_seconds, last_time
from iriftrace.flow.simulate.simulate import Display, check_solver, prepare, simulate
from iriftrace.io.field import read_field
from iriftrace.io.vtk_write import write_vtk
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.origin import facts_of, origin_of, state_origin
from iriftrace.medium.source import FieldFacts

FAMILY = "family.json"
"""Record in the family's folder: its members, and how each of the finished ones was made."""
_CASES = "cases"

_KEPT = 8
"""Members in memory: two speeds of four directions."""


@frozen(eq=False)
class Task:
    """A member to solve, possibly in another process with access to the same folder."""

    member: FamilyMember
    case: Case
    folder: Path  # of the family
    like: Path | None  # case whose mesh is reused; None to make a mesh

    @property
    def case_folder(self) -> Path:
        """Folder of its OpenFOAM case."""
        return self.folder / _CASES / self.member.name


@frozen
class Remaining:
    """Remaining work of a family."""

    finished: int
    mirrored: int  # members made by mirroring
    between: int  # members made from those around them
    solved: int  # members to solve
    cost: Cost | None  # largest mesh, time of all solvers one after another; None if none is solved


Solve = Callable[[Sequence[Task]], Iterable[JsonObject]]
"""Solves tasks in any order; yields entries of `FAMILY` as they are finished."""


def solve_member(task: Task, installation: Installation, display: Display) -> JsonObject:
    """Solve one member and write its field; its entry in `FAMILY`."""
    result = simulate(
        task.case,
        task.case_folder,
        task.folder / task.member.file,
        installation,
        display,
        task.like,
    )
    flow = result.steadiness
    return _entry(task.member, task.case) | {
        "cells": result.cells,
        "heat_w": None if flow is None else flow.heat_w,
        "steady": None if flow is None else flow.steady,
        "seconds": round(result.seconds, 1),
    }


def solve_elsewhere(task: Task) -> JsonObject:
    """Solve one member with the OpenFOAM of the machine on which a worker runs."""
    installation = find_openfoam()
    check_solver(installation)
    return solve_member(task, installation, Display())


def run_family(
    members: Sequence[FamilyMember],
    cases: Mapping[str, Case],
    folder: Path,
    installation: Installation,
    solve: Solve,
    *,
    say: Callable[[str], None],
    expect: Callable[[Remaining], None],
) -> Iterator[JsonObject]:
    """Make the missing members of a family; yields their entries as they are made.

    `cases` are by the members' names. The `folder` gets ``NAME.vtu`` of each member, `FAMILY`, and
    the OpenFOAM cases of those that `solve` solved. Callbacks: `say` gets each step, `expect` the
    expected cost before the first solver starts.
    """
    entries = _read(folder)
    tasks = _tasks(members, cases, folder)
    for task in tasks:
        prepare(task.case, task.case_folder)
    # Those with a field that was solved to the same time as requested now.
    finished = [
        member.name
        for member in members
        if (folder / member.file).is_file()
        and _entry(member, cases[member.name]).items() <= entries.get(member.name, {}).items()
    ]
    waiting = [task for task in tasks if task.member.name not in finished]
    mirrored = [m for m in members if m.image_of and m.name not in finished]
    between = [m for m in members if m.between and m.name not in finished]
    needed = {task.member.planes for task in waiting}
    cells = {
        task.member.planes: make_mesh(task.case, task.case_folder, installation, say)
        for task in tasks
        if task.like is None and task.member.planes in needed
    }
    cost = _cost(waiting, cells, continued=bool(finished))
    expect(Remaining(len(finished), len(mirrored), len(between), len(waiting), cost))
    for entry in solve(waiting):
        yield _keep(entry, entries, folder)
    for member in mirrored:
        write_image(member, cases[member.name], folder)
        yield _keep(_entry(member, cases[member.name]), entries, folder)
    reader = _reader(folder)
    for member in between:
        fields = [reader(name, cases[name]) for name, _ in member.between]
        write_field_between(folder / member.file, fields, [share for _, share in member.between])
        yield _keep(_entry(member, cases[member.name]), entries, folder)


def write_image(member: FamilyMember, case: Case, folder: Path) -> None:
    """Write the field of a member that is the mirror image of a solved one."""
    original = folder / f"{member.image_of}.vtu"
    grid = pv.UnstructuredGrid(original)
    for axis in member.across:
        number = "xy".index(axis)
        grid = reflected_grid(grid, number, float(case.part.centre[number]))
    if case.draught is not None:
        wind = case.draught.mirrored(member.across).text
        origin = origin_of(grid).replace(wind, case.draught.text)
        text = f"{origin}, mirror image of {original.name}"
        facts = facts_of(grid) or FieldFacts()
        state_origin(grid, text, evolve(facts, draught_m_s=case.draught.velocity))
    write_vtk(folder / member.file, grid)


def _reader(folder: Path) -> Callable[[str, Case], IndexField]:
    """Reader of members, which keeps those of the last places, as neighbours share them."""

    @lru_cache(maxsize=_KEPT)
    def read(name: str, case: Case) -> IndexField:
        air = Air(temperature_k=case.options.ambient, pressure_pa=case.options.pressure)
        # What a field is warned of is said again where a scene is made of it.
        with without_warnings():
            return read_field(folder / f"{name}.vtu", air=air)

    return read


def _tasks(members: Sequence[FamilyMember], cases: Mapping[str, Case], folder: Path) -> list[Task]:
    """Tasks of all members that are solved; the first of each mesh makes it."""
    tasks: list[Task] = []
    meshed: dict[str, Path] = {}
    for member in members:
        if not member.solved:
            continue
        task = Task(member, cases[member.name], folder, meshed.get(member.planes))
        meshed.setdefault(member.planes, task.case_folder)
        tasks.append(task)
    return tasks


def _cost(tasks: Sequence[Task], cells: Mapping[str, int], continued: bool) -> Cost | None:
    """Cost of all solvers one after another, on the largest of the meshes by mirror planes."""
    if not tasks:
        return None
    since = [last_time(task.case_folder) for task in tasks]
    seconds = sum(
        expected_seconds(task.case, cells[task.member.planes], start)
        for task, start in zip(tasks, since, strict=True)
    )
    largest = max(tasks, key=lambda task: cells[task.member.planes])
    return cost_of(
        largest.case,
        cells[largest.member.planes],
        seconds,
        continued=continued or any(since),
    )


def _entry(member: FamilyMember, case: Case) -> JsonObject:
    wind = case.draught
    return {
        "name": member.name,
        "field": member.file,
        "speed_m_s": 0.0 if wind is None else wind.speed,
        "from": None if wind is None else list(wind.source),
        "velocity_m_s": [0.0, 0.0, 0.0] if wind is None else list(wind.velocity),
        "image_of": member.image_of or None,
        "between": dict(member.between) or None,
        "end_s": case.times.end,
        "averaging_s": case.times.averaging,
        "bodies": [body.record() for body in case.bodies],
        "floor_mm": case.options.floor,
    }


def _read(folder: Path) -> dict[str, JsonObject]:
    """Entries of the family in a folder; raises InputError if it holds something else."""
    file = folder / FAMILY
    if file.is_file():
        members = read_record(file).get("members", [])
        return {entry["name"]: entry for entry in members}
    if folder.is_dir() and any(path.name != _CASES for path in folder.iterdir()):
        raise InputError(
            f"the folder {folder} holds files that are not a family of draughts, among which its "
            "members would be lost; name an empty or a new one.",
            code="output.replaces",
            argument="output",
        )
    return {}


def _keep(entry: JsonObject, entries: dict[str, JsonObject], folder: Path) -> JsonObject:
    """Record that a member is finished; returns its entry."""
    entries[entry["name"]] = entry
    ordered = {"members": [entries[name] for name in sorted(entries)]}
    write_whole(folder / FAMILY, json.dumps(ordered, indent=1) + "\n")
    return entry

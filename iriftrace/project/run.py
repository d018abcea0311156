"""Doing the steps of a project that are not up to date."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from attrs import evolve

from iriftrace.cli.program import app
from iriftrace.cli.project_file import Defaults, ProjectFile
from iriftrace.core.errors import InputError
from iriftrace.project.stamps import STAMP, StepState, states_of


def chosen_states(file: ProjectFile, names: Collection[str]) -> dict[str, StepState]:
    """States of the steps with these names and of those that they need; of all without names."""
    states = states_of(file)
    for name in names:
        if name not in states:
            raise InputError(
                f"The project has no step {name}; its steps are {', '.join(states)}.",
                code="project.no_step",
            )
    needed = set(names or states)
    for name, state in reversed(states.items()):
        if name in needed:
            needed.update(state.step.after)
    chosen = {name: state for name, state in states.items() if name in needed}
    _check_files(file, chosen)
    if states["scene"].reason:
        _check_features(file)
    return chosen


def _check_files(file: ProjectFile, chosen: Mapping[str, StepState]) -> None:
    """Refuse a step whose files are missing, before those before it are done."""
    for name, state in chosen.items():
        for path in state.step.files:
            if not Path(path).exists():
                raise InputError(
                    f"{file.path}: there is no {path}, which the step {name} reads; give an "
                    "existing file.",
                    code="project.no_file",
                )


def _check_features(file: ProjectFile) -> None:
    """Refuse a feature of a region that the part does not have, before a flow is solved for it."""
    devices = options_of(file, "measure", "SCENE").get("devices")
    if devices is None or not devices.feature:
        return
    from iriftrace.io.part_files import read_part
    from iriftrace.io.reading import ReadPart
    from iriftrace.measuring.features.choice import checked_choices

    scene = options_of(file, "scene", "FIELD", "PART", "--output=scene.xml")
    (mesh,) = file.texts("part", "mesh")
    # As drawn, because the temperatures by which it expands may be those of a field.
    drawn = evolve(scene.get("part_reading") or ReadPart(), expansion=None, hot_temperature=None)
    checked_choices(devices.feature, read_part(mesh, drawn))


def do_steps(
    file: ProjectFile, names: Collection[str], say: Callable[[str], None]
) -> dict[str, StepState]:
    """Do what is not up to date of the steps; returns those that were done.

    The project's folder is the current one. A step's stamp is written last, so that a killed run
    does it again, or continues it if its command does.
    """
    done = {}
    for name, state in chosen_states(file, names).items():
        if state.reason:
            say(f"{name}: {state.reason}")
            _do(file, state)
            done[name] = state
    return done


def _do(file: ProjectFile, state: StepState) -> None:
    step = state.step
    folder = step.folder
    if folder.is_dir() and any(folder.iterdir()):
        if not (folder / STAMP).is_file():
            raise InputError(
                f"{folder} holds files that no step has made, among which results would be lost; "
                "move it away.",
                code="project.other_folder",
            )
        if step.resumes and not state.continues:
            shutil.rmtree(folder)
    folder.mkdir(parents=True, exist_ok=True)
    state.write(done=False)
    started = time.perf_counter()
    with defaults_of(file, step.without):
        words = [*step.command.split(), *step.words()]
        command, bound, _ = app.parse_args(words, exit_on_error=False, print_error=False)
        command(*bound.args, **bound.kwargs)
    from iriftrace.project.results import result_of

    seconds = round(time.perf_counter() - started, 1)
    state.write(done=True, seconds=seconds, result=result_of(file, step))


def options_of(file: ProjectFile, *words: str, without: Collection[str] = ()) -> dict[str, Any]:
    """Arguments of a command's function as a project's file states them."""
    with defaults_of(file, without):
        _, bound, _ = app.parse_args(list(words), exit_on_error=False, print_error=False)
    return dict(bound.arguments)


@contextmanager
def defaults_of(file: ProjectFile, without: Collection[str] = ()) -> Iterator[None]:
    """Let the commands of the program take the values of a file inside the block."""
    former = app.config
    app.config = (Defaults(lambda: file, without),)
    try:
        yield
    finally:
        app.config = former

"""The commands ``iriftrace new``, ``run`` and ``status``: a project's file and its products."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rich.markup import escape

from iriftrace.cli import checks
from iriftrace.cli.console import PROJECT_FILE, command_line, print_table, say
from iriftrace.cli.options import Flag

if TYPE_CHECKING:
    from iriftrace.cli.project_file import ProjectFile


def new(
    folder: Path,
    *,
    part: Path,
    field: list[Path] | None = None,
    length_unit: str | None = None,
) -> None:
    """Write a project's file, iriftrace.toml, which ``iriftrace run`` accepts at once.

    What the part's file states is written as values, all else as examples, which are marked. With
    examples no verdict is given.

    Example: ``iriftrace new flange --part flange.stl``

    Parameters
    ----------
    folder
        Folder of the project; it may have files, but no iriftrace.toml.
    part
        The part's mesh.
    field
        A field of the hot air around the part; repeatable for an ensemble. Without one the air is
        an example.
    length_unit
        Unit of the part's coordinates; by default that of its file (glTF: m), else mm.
    """
    from iriftrace.io.part_files import read_part
    from iriftrace.io.reading import ReadPart
    from iriftrace.project.example import write_example

    fields = field or []
    checks.inputs(part)
    checks.fields(*fields)
    checks.folder(folder)
    read = read_part(part, ReadPart(length_unit=length_unit))
    path = write_example(folder, read, part, fields)
    say(f"Project in {path}; in its folder run:  {command_line('run')}")


def run(steps: list[str] | None = None, /, *, dry_run: Flag = False) -> None:
    """Do the steps of the project in this folder that are not up to date.

    From field to report as far as iriftrace.toml has what they need; products are in the folder
    build. A step is done again if its options, files or the steps before have changed. An
    interrupted run continues with the same command.

    Example: ``iriftrace run``

    Parameters
    ----------
    steps
        Names of steps, such as scene, which are done with those that they need; by default all.
    dry_run
        Only print what would be done, and why.
    """
    from iriftrace.project.run import chosen_states, do_steps

    file = _here()
    if dry_run:
        states = chosen_states(file, steps or ())
        rows = [(name, escape(state.reason) or "up to date") for name, state in states.items()]
        print_table(None, ("step", "to do because"), rows, texts=("step", "to do because"))
        return
    done = do_steps(file, steps or (), say)
    _print_status(file)
    if not done:
        say("All is up to date.")


def status() -> None:
    """Print the steps of the project in this folder: up to date or not, main number, file.

    Example: ``iriftrace status``
    """
    _print_status(_here())


def _here() -> ProjectFile:
    from iriftrace.cli.program import app
    from iriftrace.cli.project_file import read_project_file

    return read_project_file(Path(PROJECT_FILE), app)


def _print_status(file: ProjectFile) -> None:
    from iriftrace.project.stamps import states_of
    from iriftrace.project.steps import example_air

    states = states_of(file)
    rows = [
        (
            name,
            *(escape(text or "") for text in (one.reason or "up to date", one.stamp.get("result"))),
            one.step.product,
        )
        for name, one in states.items()
    ]
    headings = ("step", "state", "result", "file")
    print_table(None, headings, rows, texts=headings)
    if example_air(file):
        say("Example air: from formulas, not of your hall, so nothing is decided.")
    if file.example:
        say(f"Example values, with which nothing is decided: {', '.join(file.example)}.")

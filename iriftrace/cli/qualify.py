"""The command ``iriftrace qualify``: scenarios with known answers, for any tracer."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Literal

from iriftrace.cli import checks
from iriftrace.cli.console import print_table, say, working
from iriftrace.cli.options import Output
from iriftrace.core.errors import refuse_given

SCHEMA = "iriftrace.verdicts/1"
"""Value of ``schema`` in the report."""


def qualify(
    kit: Path | None = None,
    *,
    results: Path | None = None,
    engine: Literal["shells", "cells"] | None = None,
    output: Output | None = None,
) -> bool:
    """Judge a program that traces rays through hot air by scenarios whose answers are known.

    Each scenario is a folder with rays, part, temperatures, truth and bound in files that any
    program can read. Without results, both engines of this program are judged, and their answers
    are left in the kit as results_shells.json and results_cells.json. The exit status is 1 if a
    scenario fails.

    Example: ``iriftrace qualify kit --results theirs.json``

    Parameters
    ----------
    kit
        Folder of the scenarios; if it does not exist, the kit is written there, unless results
        are given. By default a temporary one.
    results
        Answers of another program, .json.
    engine
        Engine of this program that is judged; by default both.
    output
        The verdicts, .json; by default they are only printed.
    """
    if results is not None:
        reason = "is of this program, but the results are of another one; leave it out."
        refuse_given({"engine": engine}, reason, "options.not_together")
    checks.inputs(results)
    checks.output(output, "verdicts.json")
    if kit is not None:
        checks.folder(kit)
        # Answers belong to a kit that is there.
        new = results is None and not kit.exists()
        return _judged(kit, results, engine, output, new=new)
    with tempfile.TemporaryDirectory() as folder:
        return _judged(Path(folder) / "kit", results, engine, output, new=True)


def _judged(
    kit: Path, results: Path | None, engine: str | None, output: Path | None, *, new: bool
) -> bool:
    from importlib.metadata import version

    from iriftrace.core.engines import Engine
    from iriftrace.core.files import write_json
    from iriftrace.core.plain import plain
    from iriftrace.measuring.qualification import (
        judge,
        read_kit,
        read_results,
        traced_kit,
        write_kit,
    )
    from iriftrace.scenes.qualification import scenarios

    answers = [] if results is None else [read_results(results)]
    if new:
        with working("Writing the kit"):
            write_kit(kit, scenarios())
    read = read_kit(kit)
    if results is None:
        names = (Engine(engine),) if engine else (Engine.SHELLS, Engine.CELLS)
        for name in names:
            with working(f"Tracing the scenarios ({name})"):
                answers.append(traced_kit(read, name))
            write_json(kit / f"results_{name}.json", plain(answers[-1]))
    judged = {one.tracer: judge(read, one.vectors_mm) for one in answers}
    for tracer, verdicts in judged.items():
        print_table(
            tracer,
            ("scenario", "title", "rays", "error", "bound", "verdict"),
            [
                (
                    one.scenario,
                    one.title,
                    one.rays,
                    "no answer" if one.error is None else f"{one.error:.2%}",
                    f"{one.bound:.2%}",
                    "passes" if one.passes else "fails",
                )
                for one in verdicts
            ],
            texts=["scenario", "title"],
        )
        passed = sum(one.passes for one in verdicts)
        say(f"{tracer}: passes {passed} of {len(verdicts)} scenarios.")
    if output is not None:
        tables = {
            tracer: [one.as_dict() for one in verdicts] for tracer, verdicts in judged.items()
        }
        stated = {"schema": SCHEMA, "version": version("iriftrace"), "verdicts": tables}
        write_json(output, stated)
        say(f"Files: {output}")
    return all(one.passes for verdicts in judged.values() for one in verdicts)

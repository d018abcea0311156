"""What makes a step of a project out of date, and what does not."""

from pathlib import Path

import pytest
from project_file import FILE, all_done, reasons, replaced

from iriftrace.cli.program import app
from iriftrace.cli.project_file import read_project_file
from iriftrace.cli.sections import COMMANDS
from iriftrace.project.stamps import states_of


def with_fields(*names: str) -> None:
    """Give the project fields in place of the example air."""
    replaced(', "air.synthetic.wall_temperature"', "")
    text = FILE.read_text()
    begin, end = text.index("\n[air.synthetic]"), text.index("# [air.simulate]")
    listed = ", ".join(f'"{name}"' for name in names)
    FILE.write_text(text[:begin] + "\n" + text[end:])
    replaced("[air]", f"[air]\nfields = [{listed}]")


@pytest.mark.parametrize(
    ("field", "text", "file"),
    [
        ("air.pvd", '<DataSet timestep="0" file="air.vtu"/>', "air.vtu"),
        ("case/air.foam", "", "case/10/T"),
        ("case/constant/air", None, "case/10/air/T"),
        ("case", None, "case/10/T"),
    ],
)
def test_new_results_under_the_same_names_are_seen(
    project: Path, field: str, text: str | None, file: str
) -> None:
    for name in (file, "case/constant/air/polyMesh/points"):
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text("1000 K")
    if text is not None:
        Path(field).write_text(text)
    with_fields(field)
    all_done()
    Path(file).write_text("900 K")
    found = reasons()
    assert found["scene"] == f"files of {field} changed"
    assert found["measure"] == "after scene"


def test_a_picture_is_made_again_with_another_engine(project: Path) -> None:
    text = FILE.read_text()
    begin, end = text.index("[second]"), text.index("# [board]")
    FILE.write_text(text[:begin] + '[trace]\nengine = "shells"\n' + text[end:])
    replaced(', "second"', "")
    all_done()
    replaced('engine = "shells"', 'engine = "cells"')
    assert reasons()["render"] == "[trace] engine changed"
    commands = {one.step.command for one in states_of(read_project_file(FILE, app)).values()}
    assert commands <= set(COMMANDS)

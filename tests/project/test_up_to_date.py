"""Changes that put a step of a project out of date, and those that do not."""

import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest
from project_file import FILE, all_done, plan, reasons, replaced, simulate, with_fields

from iriftrace.cli.program import app
from iriftrace.cli.project_file import read_project_file
from iriftrace.cli.sections import COMMANDS
from iriftrace.project.run import do_steps
from iriftrace.project.stamps import states_of
from iriftrace.scenes import folder_of


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


def test_who_does_the_work_changes_nothing(project: Path) -> None:
    simulate('processes = 2\ndraughts = "0:0.1:0.1"\ndraught_from = "270"\nworkers = 2\n')
    plan("fibonacci = 4\nworkers = 3")
    all_done()
    replaced("processes = 2", "processes = 4")
    replaced("workers = 2", 'scheduler = "tcp://host:8786"')
    replaced("workers = 3", "workers = 2")
    assert reasons() == {}
    replaced("fibonacci = 4", "fibonacci = 5")
    assert reasons()["sweep"] == "[sweep] fibonacci changed"


def test_a_finished_flow_runs_on_to_a_later_time(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The solver continues with other times, so what it has solved is not removed."""
    simulate()
    all_done()
    solved = Path("build/field/solved/case.json")
    solved.touch()

    def killed() -> None:
        raise KeyboardInterrupt

    bound = SimpleNamespace(args=(), kwargs={}, arguments={})
    monkeypatch.setattr(type(app), "parse_args", lambda *_, **__: (killed, bound, None))
    replaced("wall_temperature =", 'end_time = "9 s"\nsnapshots = 3\nwall_temperature =')
    assert reasons()["field"] == "[air.simulate] end_time, [air.simulate] snapshots changed"
    for wall, kept in (("1050", True), ("1040", False)):
        replaced('wall_temperature = "1050', f'wall_temperature = "{wall}')
        with pytest.raises(KeyboardInterrupt):
            do_steps(read_project_file(FILE, app), ["field"], print)
        assert solved.exists() == kept


def test_bodies_next_to_a_field_are_read_with_it(project: Path) -> None:
    body = Path("hall/bodies/table.stl")
    body.parent.mkdir(parents=True)
    for file in ("hall/air.vtu", body):
        Path(file).touch()
    with_fields("hall/air.vtu")
    replaced("# [board]", "[board]")
    replaced('# mesh = "board.stl"', 'mesh = "part.stl"')
    all_done()
    body.write_text("solid")
    assert {reasons()[name] for name in ("scene", "board")} == {f"{body} changed"}


@pytest.mark.usefixtures("variant")
def test_a_further_view_is_read_with_the_files_of_its_scene(project: Path) -> None:
    across = shutil.copytree(folder_of("slab"), Path("across"))
    view = "[board]\nview = [['across/scene.xml', 'across.csv']]"
    replaced("# [board]", view)
    replaced('# mesh = "board.stl"', 'mesh = "part.stl"')
    replaced('# shifts = "shifts.csv"', 'shifts = "shifts.csv"')
    Path("shifts.csv").touch()
    assert reasons()["fit"] == "across.csv is missing"
    Path("across.csv").touch()
    all_done()
    part = next(across.glob("part.*"))
    part.write_bytes(part.read_bytes() + b"\n")
    assert reasons()["fit"] == f"{part} changed"


def test_the_order_of_fields_counts(project: Path) -> None:
    for name in ("still.vtu", "draught.vtu"):
        Path(name).write_text(name)
    with_fields("still.vtu", "draught.vtu")
    all_done()
    replaced('"still.vtu", "draught.vtu"', '"draught.vtu", "still.vtu"')
    assert reasons()["scene"] == "[air] fields changed"

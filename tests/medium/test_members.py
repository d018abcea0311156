"""States of series of files: times against those written, and how a user names one."""

import json
from pathlib import Path

import numpy as np
import pytest

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.field import read_field
from iriftrace.io.members import member_at, members
from validation.inputs.field_grids import AMBIENT, solid


@pytest.fixture(params=["run.pvd", "run.vtu.series"])
def series(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """Three times, the file names in another order than the times, as ParaView writes them."""
    for step, offset in (("c", 0.5), ("a", 1.0), ("b", 1.5)):
        grid = solid()
        grid.point_data["T"] = np.full(grid.n_points, AMBIENT) + offset
        grid.save(tmp_path / f"{step}.vtu")
    times = ((0.1, "c"), (0.25, "a"), (10, "b"))
    entries = "".join(
        f'<DataSet timestep="{time}" part="0" file=".\\{step}.vtu"/>' for time, step in times
    )
    text = f'<VTKFile type="Collection" version="0.1"><Collection>{entries}</Collection></VTKFile>'
    path = tmp_path / str(request.param)
    if path.suffix == ".series":
        files = [{"name": f"{step}.vtu", "time": time} for time, step in times]
        text = json.dumps({"file-series-version": "1.0", "files": files})
    path.write_text(text)
    return path


def test_a_series_lists_its_times_and_reads_each(series: Path) -> None:
    found = members(series)
    assert [(m.label, m.time, m.index) for m in found] == [
        ("t = 0.1", 0.1, 0),
        ("t = 0.25", 0.25, 1),
        ("t = 10", 10.0, 2),
    ]
    for member in found:
        field = read_field(series, member=member.index)
        assert field.temperature_k.max() == pytest.approx(AMBIENT + 0.5 + 0.5 * member.index)
        assert field.source.origin == member.label
    with pytest.warns(IriftraceWarning, match="3 states; the last one, t = 10, is used"):
        assert read_field(series).temperature_k.max() == pytest.approx(AMBIENT + 1.5)


def test_files_of_a_series_without_times_are_no_single_state(tmp_path: Path) -> None:
    for name in ("a", "b"):
        solid().save(tmp_path / f"{name}.vtu")
    sets = "".join(f'<DataSet part="0" file="{name}.vtu"/>' for name in ("a", "b"))
    (tmp_path / "run.pvd").write_text(f"<VTKFile><Collection>{sets}</Collection></VTKFile>")
    with pytest.raises(InputError, match="has 2 files of one part without a timestep"):
        members(tmp_path / "run.pvd")


def test_a_time_with_fewer_files_than_others_is_refused(tmp_path: Path) -> None:
    """Processes write a file each; a run that was stopped leaves the last time incomplete."""
    solid().save(tmp_path / "a.vtu")
    box = solid()
    box.points += np.array((10.0, 0.0, 0.0), dtype=box.points.dtype)
    box.save(tmp_path / "b.vtu")
    files = (("0", "a"), ("0", "b"), ("1", "a"))
    sets = "".join(f'<DataSet timestep="{time}" file="{name}.vtu"/>' for time, name in files)
    path = tmp_path / "run.pvd"
    path.write_text(f"<VTKFile><Collection>{sets}</Collection></VTKFile>")
    assert read_field(path, member=0).grid.volume == pytest.approx(2000.0)
    with pytest.raises(InputError, match=r"names 1 of 2 files at t = 1.; choose another time"):
        read_field(path, member=1)


@pytest.mark.parametrize(
    ("when", "index"),
    [("latest", 2), ("first", 0), ("0.25", 1), ("2.5e-1", 1), (" t=10 ", 2), ("10", 2)],
)
def test_a_state_can_be_named(series: Path, when: str, index: int) -> None:
    assert member_at(series, when).index == index


@pytest.mark.parametrize("when", ["3", "t = 3", "last", ""])
def test_states_that_are_not_there(series: Path, when: str) -> None:
    with pytest.raises(InputError, match=r"no state .* it has t = 0.1; t = 0.25; t = 10"):
        member_at(series, when)


def test_a_plain_file_has_one_state(tmp_path: Path) -> None:
    solid().save(tmp_path / "f.vtu")
    (member,) = members(tmp_path / "f.vtu")
    assert (member.label, member.time) == ("", None)
    assert read_field(tmp_path / "f.vtu", member=0).source.origin == ""
    with pytest.raises(InputError, match="no state '3': it has one state without a time"):
        member_at(tmp_path / "f.vtu", "3")


@pytest.mark.parametrize(
    ("name", "words"),
    [("none.vtu", "There is no file"), ("f.xlsx", "not a field file"), ("f.pvd", "f.pvd")],
)
def test_files_without_states(tmp_path: Path, name: str, words: str) -> None:
    if not name.startswith("none"):
        (tmp_path / name).write_text("<VTKFile/>")
    with pytest.raises(InputError, match=words):
        members(tmp_path / name)

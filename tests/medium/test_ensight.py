"""EnSight Gold cases in text and binary, with one state and with several."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.field import read_field
from iriftrace.io.members import member_at, members
from iriftrace.medium.index_field import IndexField
from validation.field_files import ensight
from validation.inputs.field_grids import AMBIENT, solid


def write(
    folder: Path, *, binary: bool, times: tuple[float, ...] = (), name: str = "a.case"
) -> Path:
    """The box of air; at later times the air is 10 K hotter each."""
    grid = solid()
    kelvin = AMBIENT + 50.0 * np.asarray(grid.points)[:, 0]
    states = [kelvin + 10.0 * step for step in range(max(1, len(times)))]
    return ensight.write(folder / name, grid, states, binary=binary, times=times)


def assert_the_box(field: IndexField, hotter: float = 0.0) -> None:
    """T = ambient + 50 x in 1000 mm3."""
    assert field.grid.volume == pytest.approx(1000.0)
    expected = AMBIENT + 50.0 * np.asarray(field.grid.points)[:, 0] + hotter
    assert_allclose(field.temperature_k, expected, rtol=1e-5)


@pytest.mark.parametrize("name", ["a.case", "a.encas", "A.CASE"])
@pytest.mark.parametrize("binary", [False, True], ids=["text", "binary"])
def test_a_steady_case(tmp_path: Path, binary: bool, name: str) -> None:
    field = read_field(write(tmp_path, binary=binary, name=name))
    assert_the_box(field)
    assert field.source.array == "T"
    assert field.source.length_unit == "mm"


@pytest.mark.filterwarnings("ignore:The coolest air")
@pytest.mark.parametrize("binary", [False, True], ids=["text", "binary"])
def test_a_case_with_several_times(tmp_path: Path, binary: bool) -> None:
    path = write(tmp_path, binary=binary, times=(0.0, 0.5, 2.0))
    assert [m.time for m in members(path)] == [0.0, 0.5, 2.0]
    assert_the_box(read_field(path, member=member_at(path, "0.5").index), 10.0)
    with pytest.warns(IriftraceWarning, match="3 states; the last one, t = 2.0, is used"):
        assert_the_box(read_field(path), 20.0)


def test_states_need_a_time_each(tmp_path: Path) -> None:
    path = write(tmp_path, binary=False, times=(0.0, 0.5, 2.0))
    text = path.read_text()
    assert "number of steps: 3" in text
    path.write_text(text[: text.index("time values")])
    with pytest.raises(InputError, match="states 3 steps and 0 time values"):
        members(path)


def test_damaged_cases_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path, binary=True)
    geometry = (tmp_path / "a.geo").read_bytes()
    (tmp_path / "a.geo").write_bytes(geometry[: len(geometry) // 2])
    with pytest.raises(InputError, match=r"cannot be read|no volume cells"):
        read_field(path)
    (tmp_path / "a.geo").unlink()
    with pytest.raises(InputError, match=r"names a.geo, which is not next to it"):
        read_field(path)
    path.write_text("something else")
    with pytest.raises(InputError, match="is not an EnSight case"):
        read_field(path)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda text: "\ufeff" + text, "has a byte order mark or keywords"),
        (
            lambda text: text.replace("type: ensight", "TYPE: ENSIGHT"),
            "has a byte order mark or keywords",
        ),
        (
            lambda text: text.replace("ensight gold", "EnSight Gold"),
            "has a byte order mark or keywords",
        ),
        (lambda text: text.replace("GEOMETRY", "Geometry"), "has a byte order mark or keywords"),
        (lambda text: text.replace("a.geo", "/data/run/a.geo"), "a file named by its folder"),
        (lambda text: text.replace("a.geo", r".\a.geo"), "a file named by its folder"),
    ],
)
def test_what_vtk_does_not_read_is_said(
    tmp_path: Path, change: Callable[[str], str], said: str
) -> None:
    path = write(tmp_path, binary=False)
    path.write_text(change(path.read_text()), encoding="utf-8")
    with pytest.raises(InputError, match=said):
        read_field(path)

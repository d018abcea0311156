"""The heat in what the solver averaged or wrote: known states, and fields that lack some of it."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from attrs import evolve

from iriftrace.flow.simulate import result
from iriftrace.flow.simulate.case import Case
from iriftrace.flow.simulate.case_files import write_control
from iriftrace.flow.simulate.options import SimulationOptions
from iriftrace.flow.simulate.result import mean_arrays, state_arrays, write_snapshots
from iriftrace.medium.air import thermophysics as gas
from iriftrace.medium.flow import ENTHALPY_FLUX, HEAT_STORAGE
from validation.field_files.openfoam import entry

ROOM, PRESSURE = 303.15, 95000.0
BEFORE, AFTER = np.array([400.0, 700.0, 900.0]), np.array([410.0, 700.0, 880.0])
UPWARD = np.array([0.0, 0.0, 0.8])


@pytest.fixture
def air(case: Case) -> Case:
    return evolve(case, options=SimulationOptions(ambient=ROOM, pressure=PRESSURE))


def state(kelvin: np.ndarray) -> pv.PolyData:
    """Points of a case that moves upward, as the reader makes them."""
    grid = pv.PolyData(np.arange(9.0).reshape(3, 3))
    grid.point_data["T"] = kelvin
    grid.point_data["U"] = np.tile(UPWARD, (3, 1))
    grid.point_data["U/T"] = UPWARD / kelvin[:, None]
    return grid


def averaged() -> pv.PolyData:
    """The last state with averages over two states of the same length, `BEFORE` and `AFTER`."""
    grid = state(AFTER)
    density = gas.density(BEFORE, PRESSURE), gas.density(AFTER, PRESSURE)
    grid.point_data["rhoMean"] = np.mean(density, axis=0)
    grid.point_data["UMean"] = np.tile(UPWARD, (3, 1))
    grid.point_data["rhoUMean"] = np.mean(density, axis=0)[:, None] * UPWARD
    return grid


def content(kelvin: np.ndarray) -> np.ndarray:
    return gas.heat_content(kelvin, ROOM, PRESSURE)


def test_average_of_two_states(air: Case) -> None:
    arrays = mean_arrays(air, averaged(), state(BEFORE), 0.25)
    assert arrays["U"] == pytest.approx(np.tile(UPWARD, (3, 1)))
    both = 0.5 * (content(BEFORE) + content(AFTER))
    assert arrays[ENTHALPY_FLUX] == pytest.approx(both[:, None] * UPWARD, rel=1e-4)
    assert arrays[HEAT_STORAGE] == pytest.approx((content(AFTER) - content(BEFORE)) / 0.25)


def test_what_the_solver_did_not_average_is_left_out(air: Case) -> None:
    grid = averaged()
    grid.point_data.remove("rhoUMean")
    assert set(mean_arrays(air, grid, state(BEFORE), 0.25)) == {"U", HEAT_STORAGE}
    grid.point_data.remove("UMean")
    assert mean_arrays(air, grid, state(BEFORE), 0.25) == {}


def test_single_state_and_its_rate(air: Case) -> None:
    """d/dt of the heat content is its slope over the density times the density's rate."""
    grid = state(BEFORE)
    assert set(state_arrays(air, grid)) == {"U", ENTHALPY_FLUX}
    seconds = 1e-5
    later = BEFORE + np.array([30.0, 0.0, -80.0]) * seconds
    change = gas.density(later, PRESSURE) - gas.density(BEFORE, PRESSURE)
    grid.point_data["ddtRho"] = change / seconds
    arrays = state_arrays(air, grid)
    assert arrays[ENTHALPY_FLUX] == pytest.approx(content(BEFORE)[:, None] * UPWARD)
    rate = (content(later) - content(BEFORE)) / seconds
    assert arrays[HEAT_STORAGE] == pytest.approx(rate, rel=1e-5, abs=1e-3)


def test_solver_is_told_to_average_what_the_balance_needs(case: Case, tmp_path: Path) -> None:
    """And to keep the heat in what it averages: the flow is solved three times a step then, unless
    it stands still.
    """
    (tmp_path / "system").mkdir()
    control, solution = tmp_path / "system/controlDict", tmp_path / "system/fvSolution"
    write_control(case, tmp_path, averaging=False)
    assert "rhoU" not in control.read_text()
    assert "nOuterCorrectors 1; nCorrectors 2;" in solution.read_text()
    write_control(case, tmp_path, averaging=True, start=1.5)
    text = control.read_text()
    for name in ("rho", "U", "rhoU"):
        assert f"{name} {{ mean on; prime2Mean off; base time; }}" in text
    assert text.index("derived (rhoU)") < text.index("type fieldAverage"), "made before averaged"
    assert "result ddtRho" in text
    assert "nOuterCorrectors 3; nCorrectors 1;" in solution.read_text()
    assert entry(control, "endTime") == "2.0"
    write_control(case, tmp_path, averaging=True, start=1.5, steady=True)
    assert control.read_text() == text
    assert "nOuterCorrectors 1; nCorrectors 2;" in solution.read_text()


def test_snapshots_are_states_of_the_averaged_time(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two remain after 1.8 s, when averaging began, though four were requested."""
    times = (1.5, 1.8, 1.9, 2.0)
    monkeypatch.setattr(result.openfoam_case, "states", lambda _: [("", time) for time in times])
    monkeypatch.setattr(result, "_read", lambda _, number: (state(AFTER), times[number]))
    monkeypatch.setattr(result, "_whole", lambda *_: pv.UnstructuredGrid())
    monkeypatch.setattr(result, "_write", lambda *_: None)
    four = evolve(case, times=evolve(case.times, snapshots=4))
    files = write_snapshots(four, tmp_path, tmp_path / "f.pvd", 2.0 - 1.8)
    assert [file.name for file in files] == ["f_1.vtu", "f_2.vtu"]
    listed = (tmp_path / "f.pvd").read_text()
    assert [moment in listed for moment in ('"1.5"', '"1.8"', '"1.9"', '"2"')] == [0, 0, 1, 1]

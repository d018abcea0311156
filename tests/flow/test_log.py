"""Facts read from a running solver's files."""

from pathlib import Path

import numpy as np
import pytest

from iriftrace.flow.simulate import programs as log

SOLVER_LOG = """\
Courant Number mean: 0.0019 max: 0.0062
Time = 0.00015

PIMPLE: iteration 1
GAMG:  Solving for p_rgh, Initial residual = 1, Final residual = 0.012, No Iterations 3
ExecutionTime = 0.03 s  ClockTime = 0 s

Courant Number mean: 0.2 max: 1.96
deltaT = 0.0004
Time = 0.0003

ExecutionTime = 1.51 s  ClockTime = 2 s
"""


def test_steps_of_a_log() -> None:
    assert log.courant_numbers(SOLVER_LOG).tolist() == [0.0062, 1.96]
    assert log.step_times(SOLVER_LOG).tolist() == [0.00015, 0.0003]


def test_logs_that_have_just_begun_or_hold_no_numbers(tmp_path: Path) -> None:
    begun = "Create time\n\nCreate mesh for time = 0\n"
    assert len(log.step_times(begun)) == len(log.courant_numbers(begun)) == 0
    wrong = log.courant_numbers("Courant Number mean: -nan max: -nan\nTime = 0.1\n")
    assert np.isnan(wrong).all()
    assert log.tail(tmp_path / "log.solver") == ""
    assert len(log.read_heat(tmp_path)) == len(log.read_plume(tmp_path)) == 0


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            "--> FOAM FATAL ERROR: \nMaximum number of iterations exceeded: 100\n\n    From f\n",
            "Maximum number of iterations exceeded: 100",
        ),
        (
            "--> FOAM FATAL IO ERROR: \nkeyword wall is undefined\n in dictionary T\n\nfile: 0/T\n",
            "keyword wall is undefined in dictionary T",
        ),
        ("#0  Foam::error::printStack\n#1  Foam::sigFpe::sigHandler(int)\n", "floating point"),
        (SOLVER_LOG, ""),
    ],
)
def test_reason_of_a_failure(text: str, reason: str) -> None:
    assert reason in log.failure(text)
    assert bool(log.failure(text)) == bool(reason)


def test_cells_of_the_mesh() -> None:
    assert log.cell_count("Mesh stats\n    points:  100\n    cells:            28556\n") == 28556
    assert log.cell_count("nothing") is None


def test_heat_of_a_run_that_went_on(tmp_path: Path) -> None:
    """Rows of the second start replace those of the first that it computed again."""
    write(tmp_path / "heat/0/surfaceFieldValue.dat", "# Time \tareaIntegrate\n0.1\t80\n0.3\t70\n")
    write(tmp_path / "heat/0.2/surfaceFieldValue.dat", "# Time\n0.3 71.5\n0.4 72\n0.5 7")
    assert log.read_heat(tmp_path).tolist() == [[0.1, 80], [0.3, 71.5], [0.4, 72], [0.5, 7]]


def test_plume_without_the_row_that_is_being_written(tmp_path: Path) -> None:
    text = "# Probe 0 (0.001 0.001 0.03)\n#  Time\n  0.1  300.5  293.2\n  0.2  310  293.3\n  0."
    write(tmp_path / "plume/0/T", text)
    assert log.read_plume(tmp_path).tolist() == [[0.1, 300.5, 293.2], [0.2, 310.0, 293.3]]


def write(path: Path, text: str) -> None:
    path = path.parents[2] / "postProcessing" / path.relative_to(path.parents[2])
    path.parent.mkdir(parents=True)
    path.write_text(text)

"""Length of a simulation."""

import pytest

from iriftrace.core.errors import InputError
from iriftrace.flow.simulate.case import STANDARD_SIMULATION
from iriftrace.flow.simulate.options import SimulationOptions
from iriftrace.flow.simulate.times import Times, natural_times


def test_two_seconds_for_the_papers_cylinder() -> None:
    times = natural_times(STANDARD_SIMULATION, 170.0, 1373.15)
    assert (times.end, times.averaging, times.settled) == (2.0, 0.5, 1.5)


def test_larger_and_cooler_parts_need_longer() -> None:
    """Buoyant air needs sqrt(L / (g dT/T)): twice as long for four times the part."""
    assert natural_times(STANDARD_SIMULATION, 680.0, 1373.15).end == pytest.approx(4.0, abs=0.02)
    assert natural_times(STANDARD_SIMULATION, 170.0, 353.15).end == pytest.approx(8.48, abs=0.02)
    assert natural_times(STANDARD_SIMULATION, 10.0, 1373.15).end == 2.0


def test_snapshots_divide_the_averaging() -> None:
    times = natural_times(
        SimulationOptions(end_time=3.0, average_time=1.0, snapshots=10), 170.0, 1373.15
    )
    assert times.averaging_interval == pytest.approx(0.1)
    assert times.settled == 2.0


@pytest.mark.parametrize(
    ("end", "averaging", "snapshots"),
    [(0.0, 0.1, 0), (-1.0, 0.1, 0), (1.0, 2.0, 0), (1.0, 0.0, 0), (1.0, 0.5, -1)],
)
def test_impossible_times_are_refused(end: float, averaging: float, snapshots: int) -> None:
    with pytest.raises(InputError):
        Times(end, averaging, snapshots)

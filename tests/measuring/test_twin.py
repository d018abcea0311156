"""Repeats against simulated ones, by hand-computed E and vagueness."""

import json
from pathlib import Path

import numpy as np
import pytest

from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.io.repeats import read_repeats
from iriftrace.measuring.uncertainty.twin import compare_twin


def repeats(mean: float, scatter: float) -> np.ndarray:
    """Three values with this mean and standard deviation."""
    return mean + scatter * np.array((-1.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("off", "s_sim", "passes"),
    [
        (0.003, 0.003, True),
        (0.015, 0.003, False),  # too far
        (0.003, 0.012, False),  # only vague
    ],
)
def test_a_twin_must_agree_and_not_be_vague(off: float, s_sim: float, passes: bool) -> None:
    """u_p 4 um, u_cal 2 um, u_b 1 um."""
    (found,) = compare_twin(
        {"bore": repeats(20.0, 0.004)},
        {"bore": repeats(20.0 + off, s_sim)},
        u_cal_mm=0.002,
        u_b_mm=0.001,
    )
    total = np.sqrt(s_sim**2 + 0.004**2 + 0.002**2 + 0.001**2)
    assert found.e == pytest.approx(off / (2.0 * total))
    assert found.vagueness == pytest.approx((0.002 + s_sim) / 0.004)
    assert found.passes is passes


def test_the_command_reads_tables_with_units(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    real, simulated = tmp_path / "real.csv", tmp_path / "simulated.csv"
    real.write_text("bore [mm],height\n20.001,50.0\n20.003,50.01\n20.002,49.99\n")
    simulated.write_text("bore [um],height\n20002,50.3\n20003,50.301\n20001,50.302\n,50.299\n")
    out = tmp_path / "twin.json"
    words = ["twin", str(real), str(simulated), "--calibration-uncertainty=0.5 um", "-o", str(out)]
    assert main(words) == 0
    assert "passes for 1 of 2 features" in capsys.readouterr().out
    bore, height = json.loads(out.read_text())["features"]
    assert bore["simulated"] == pytest.approx(20.002)
    assert (bore["passes"], height["passes"]) == (True, False)
    assert len(read_repeats(simulated)["height"]) == 4


@pytest.mark.parametrize(
    ("real", "simulated", "code"),
    [
        ({"a": [1.0, 2.0, 3.0]}, {"b": [1.0, 2.0, 3.0]}, "twin.other_features"),
        ({"a": [1.0, 2.0]}, {"a": [1.0, 2.0, 3.0]}, "twin.few_repeats"),
        ({"a": [1.0, 1.0, 1.0]}, {"a": [1.0, 2.0, 3.0]}, "twin.no_scatter"),
    ],
)
def test_tables_that_say_nothing_are_refused(
    real: dict[str, list[float]], simulated: dict[str, list[float]], code: str
) -> None:
    with pytest.raises(InputError) as error:
        compare_twin(
            {name: np.array(values) for name, values in real.items()},
            {name: np.array(values) for name, values in simulated.items()},
        )
    assert error.value.code == code

"""The commands budget, render --uncertainty and correct --tolerance, as users type them."""

import json
from pathlib import Path

import numpy as np
import pytest

from iriftrace.cli import main
from iriftrace.io.exr import read_exr
from iriftrace.scenes import folder_of

CYLINDER = str(folder_of("cylinder") / "scene.xml")
FRINGE = str(folder_of("fringe_cylinder") / "scene.xml")
SMALL = ("-D", "scale=0.1")

pytestmark = pytest.mark.usefixtures("variant")

Printed = pytest.CaptureFixture[str]


def test_a_picture_has_the_uncertainty_of_its_displacement(tmp_path: Path) -> None:
    """4 and 3 % of the air's effect are 5 % of the displacement of each pixel."""
    exr = tmp_path / "out.exr"
    words = ["render", CYLINDER, "-o", str(exr), *SMALL, "--no-figures"]
    assert main([*words, "--uncertainty=air 4 %, mesh 3 %"]) == 0
    channels = read_exr(exr).channels
    u, norm = channels["displacement.u.norm"], channels["displacement.norm"]
    good = channels["status.code"] == 0
    assert good.sum() > 1000
    np.testing.assert_allclose(u[good], 0.05 * norm[good], rtol=1e-4, atol=1e-9)
    assert not u[~good].any()
    assert main([*words, "--uncertainty=air"]) == 2
    assert main(words) == 0
    assert "displacement.u.norm" not in read_exr(exr).channels


def test_a_budget_of_a_camera_states_displacement_and_shift(
    tmp_path: Path, capsys: Printed
) -> None:
    out = tmp_path / "budget.json"
    assert main(["budget", CYLINDER, *SMALL, "--uncertainty=air 5 %", "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert "Displacement, median: " in said
    assert "Not in U: turbulence" in said
    median = json.loads(out.read_text())["displacement"]["median"]
    assert median["U_mm"] == pytest.approx(0.1 * median["value_mm"], rel=1e-6)
    assert main(["budget", CYLINDER, *SMALL]) == 2
    assert "--uncertainty" in capsys.readouterr().err


CONE = "cone:lateral=27 -0.1 0.1 mm"
"""Of a cone the diameter depends on the height at which it was measured, and so on the view."""


def test_a_budget_of_two_devices_decides_on_a_tolerance(tmp_path: Path, capsys: Printed) -> None:
    out = tmp_path / "budget.json"
    words = ["budget", FRINGE, *SMALL, "-o", str(out), "--uncertainty=air 5 %, sensor 8 um"]
    assert main([*words, "--tolerance=cylinder:lateral=27 -0.05 0.05 mm"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "26.9500 .. 27.0500 mm: accepted, risk of a wrong verdict below 0.01 %" in said
    assert "Sizes hold at the temperature that the part had when it was measured" in said
    (row,) = json.loads(out.read_text())["features"]
    assert row["decision"]["verdict"] == "accepted"
    assert sum(one["share"] for one in row["contributions"]) == pytest.approx(1.0)
    assert main([*words, "--tolerance=cylinder:lateral=27 0.05 0.06 mm"]) == 0
    assert "rejected" in capsys.readouterr().out
    for wrong in (
        "cylinder:lateral=27",
        "cylinder:bore=27 0 1 mm",
        "cylinder:lateral=27 0 1",
        "lateral=27 -0.1 0.1 mm",
        CONE,
    ):
        assert main([*words, f"--tolerance={wrong}"]) == 2
        assert "--tolerance" in capsys.readouterr().err

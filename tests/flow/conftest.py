"""Fixtures of the tests of the OpenFOAM case."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from iriftrace.cli import main
from iriftrace.flow.simulate.case import Case
from iriftrace.flow.simulate.domain import mesh_size
from iriftrace.flow.simulate.times import Times
from iriftrace.part.part import Part
from iriftrace.part.wall_temperature import WallTemperatures
from validation.inputs.parts import bar_of_halves, papers_cylinder


@pytest.fixture(scope="session")
def cylinder() -> Part:
    """The paper's cylinder, its axis along x, moved off the origin."""
    return papers_cylinder()


@pytest.fixture(scope="session")
def case(cylinder: Part) -> Case:
    """A quarter of the cylinder's air."""
    size = mesh_size("coarse", np.ptp(cylinder.bounds, axis=0))
    return Case(cylinder, WallTemperatures(1373.15), size, Times(2.0, 0.5), mirrors="xy")


@pytest.fixture(scope="session")
def halves() -> Part:
    """A bar along x of two materials that meet at x = 0."""
    return bar_of_halves()


@pytest.fixture
def fails(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., str]:
    """Run a wrong command in a folder of its own; its message, once it has written nothing."""
    monkeypatch.chdir(tmp_path)

    def run(*words: str) -> str:
        before = sorted(Path().rglob("*"))
        capsys.readouterr()
        assert main(list(words)) == 2
        said = " ".join(capsys.readouterr().err.split())
        assert said.startswith(("error: ", "warning: "))
        assert sorted(Path().rglob("*")) == before, "something was written"
        return said

    return run

"""What the tests of the OpenFOAM case share."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh

from iriftrace.cfd.openfoam.case import Case
from iriftrace.cfd.openfoam.domain import mesh_size
from iriftrace.cfd.openfoam.times import Times
from iriftrace.cfd.openfoam.wall import WallTemperatures
from iriftrace.cli import main
from iriftrace.part.part import Part
from iriftrace.part.regions import Regions
from validation.inputs.parts import part_from


@pytest.fixture(scope="session")
def cylinder() -> Part:
    """The paper's cylinder, its axis along x, moved off the origin."""
    mesh = trimesh.creation.cylinder(13.5, 170.0, sections=48)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
    mesh.apply_translation((5.0, -3.0, 2.0))
    return part_from(mesh)


@pytest.fixture(scope="session")
def case(cylinder: Part) -> Case:
    """A quarter of the cylinder's air."""
    size = mesh_size("coarse", np.ptp(cylinder.bounds, axis=0))
    return Case(cylinder, WallTemperatures(1373.15), size, Times(2.0, 0.5), mirrors="xy")


@pytest.fixture(scope="session")
def halves() -> Part:
    """A bar along x of two materials that meet at x = 0."""
    mesh = trimesh.creation.box(extents=(100.0, 10.0, 10.0))
    for _ in range(3):
        mesh = mesh.subdivide()
    right = mesh.triangles_center[:, 0] > 0.0
    return part_from(mesh, Regions(right.astype(np.int64), ("steel", "nickel")))


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

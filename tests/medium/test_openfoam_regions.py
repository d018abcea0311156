"""OpenFOAM cases of conjugate heat transfer, a mesh for each region: the air and its wall."""

import re
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError
from iriftrace.io.field import read_field, read_volume
from iriftrace.io.members import members
from validation.field_files.openfoam import write_case
from validation.inputs.hot_block import AMBIENT, HALF, OUTER, air_in_metres, patches

WALL, CORE = 967.25, 1100.0
COUPLED = (
    "type compressible::turbulentTemperatureCoupledBaffleMixed; Tnbr T; kappaMethod fluidThermo; "
    "refValue uniform 3; refGradient uniform 0; valueFraction uniform 0.7; "
    "value nonuniform List<scalar> {count}({values});"
)


@pytest.fixture(params=["whole", "decomposed"])
def case(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """Air and block as solved, next to the unsplit mesh with the initial air, as blockMesh left."""
    folder = tmp_path / "case"
    air = air_in_metres()
    axis = np.array((-HALF, 0.0, HALF)) / 1e3
    block = pv.StructuredGrid(*np.meshgrid(axis, axis, axis, indexing="ij"))
    for region, grid, kelvin in (
        ("air", air, AMBIENT),
        ("block", block.cast_to_unstructured_grid(), CORE),
    ):
        halves = (np.asarray(grid.cell_centers().points)[:, 0] > 0).astype(int)
        processors = halves if request.param == "decomposed" else None
        fields = {time: {"T": np.full(grid.n_cells, kelvin)} for time in ("1", "2")}
        write_case(folder, grid, fields, patches(1.0, AMBIENT), processors=processors)
        for piece in (folder, *folder.glob("processor*")):
            for mesh in piece.glob("constant/polyMesh"):
                (mesh.parent / region).mkdir()
                mesh.rename(mesh.parent / region / "polyMesh")
            for file in piece.glob("[12]/T"):
                (file.parent / region).mkdir()
                file.rename(file.parent / region / "T")
    for file in folder.rglob("[12]/air/T"):
        count = 12 if request.param == "decomposed" else 24
        text = COUPLED.format(count=count, values=f"{WALL} " * count)
        file.write_text(re.sub(r"block\s*{[^}]*}", f"block {{ {text} }}", file.read_text()))
        file.with_name("U").write_text("not read here")
    write_case(folder, air, {"0": {"T": np.full(air.n_cells, 500.0)}}, patches(500.0))
    return folder


def properties(case: Path, fluids: str) -> None:
    (case / "constant/regionProperties").write_text(
        f"FoamFile {{ object regionProperties; }}\n"
        f"regions\n(\n    // fluid (block)\n    fluid ({fluids})\n    solid (block)\n);\n"
    )


@pytest.mark.parametrize("stated", ["fluid (air)", 'fluid 1("air")', ""])
def test_the_air_is_read_with_the_temperature_of_the_coupled_wall(case: Path, stated: str) -> None:
    """By regionProperties, or without it by the velocity, which a solid does not have."""
    if stated:
        properties(case, "air")
        file = case / "constant/regionProperties"
        file.write_text(file.read_text().replace("fluid (air)", stated))
        for file in case.rglob("U"):
            file.unlink()
    assert [member.label for member in members(case)] == ["t = 1", "t = 2"]
    field = read_field(case, member=1)
    assert field.source.origin == "OpenFOAM buoyantPimpleFoam, region air, t = 2 s"
    assert field.grid.volume == pytest.approx((2 * OUTER) ** 3 - (2 * HALF) ** 3)
    wall = (np.abs(np.asarray(field.grid.points)) < 1.001 * HALF).all(axis=1)
    assert wall.sum() == 26
    assert_allclose(field.temperature_k[wall], WALL, rtol=1e-7)
    assert_allclose(field.temperature_k[~wall], AMBIENT, rtol=1e-7)


def test_another_region_is_read_by_its_folder(case: Path) -> None:
    properties(case, "air block")
    words = r"regions air, block, of which air and block are fluid.*such as .*constant/air\."
    with pytest.raises(InputError, match=words):
        read_volume(case)
    (case / "constant/block").mkdir(exist_ok=True)
    block = read_volume(case / "constant/block", member=1).data
    assert block.volume == pytest.approx((2 * HALF / 1e3) ** 3)
    inner = (np.abs(np.asarray(block.points)) < 0.999e-3 * HALF).all(axis=1)
    assert_allclose(np.asarray(block["T"])[inner], CORE, rtol=1e-7)
    properties(case, "")
    with pytest.raises(InputError, match="of which none are fluid"):
        read_volume(case)


def test_a_case_with_results_of_its_own_is_read_without_its_regions(case: Path) -> None:
    """Such as one with the liquid film on a wall as a region."""
    air = air_in_metres()
    write_case(case, air, {"3": {"T": np.full(air.n_cells, 400.0)}}, patches(400.0))
    with_film = read_volume(case)
    assert with_film.origin == "OpenFOAM buoyantPimpleFoam, t = 3 s"
    assert_allclose(np.asarray(with_film.data["T"]), 400.0, rtol=1e-7)

"""OpenFOAM's walls with a gradient: value = the cell's + gradient times distance."""

import re
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.field import read_volume
from iriftrace.io.openfoam_walls import boundary_entries
from validation.field_files.openfoam import Form, write_case
from validation.inputs.hot_block import HALF, air_in_metres, patches

CELL, WALL = 440.0, 740.0
GRADIENT = (WALL - CELL) / 0.003
"""K/m; the centres of the cells lie 3 mm from the 24 faces of the wall."""


def case_with(
    folder: Path, block: str, name: str = "block", form: Form = "ascii", parts: bool = False
) -> Path:
    """Air of one temperature around the hot block, whose wall states the given entries."""
    grid = air_in_metres()
    processors = (np.asarray(grid.cell_centers().points)[:, 0] > 0).astype(int) if parts else None
    fields = {"1": {"T": np.full(grid.n_cells, CELL)}}
    written = "ascii" if form == "gz" else form
    write_case(folder, grid, fields, patches(1.0, 293.0), form=written, processors=processors)
    for file in folder.rglob("1/T"):
        raw = file.read_bytes().decode("latin-1")
        raw = re.sub(r"block\s*\{[^}]*\}", lambda _: f"{name}\n{{\n{block}\n}}", raw)
        assert block in raw
        file.write_bytes(raw.encode("latin-1"))
    return folder


def at_wall(case: Path) -> np.ndarray:
    """Temperatures at the 26 points of the wall."""
    grid: pv.UnstructuredGrid = read_volume(case).data
    wall = (np.abs(np.asarray(grid.points)) < 1.001 * HALF / 1e3).all(axis=1)
    assert wall.sum() == 26
    return np.asarray(grid.point_data["T"])[wall]


BRACES = f"{{{GRADIENT!r}}}"
LIST = "\n24\n(\n" + f"{GRADIENT!r}\n" * 24 + ")\n"
STATED = {
    "uniform": f"type fixedGradient; gradient uniform {GRADIENT!r};",
    "list": f"type fixedGradient;\ngradient nonuniform List<scalar> {LIST};",
    "list of one value": f"type fixedGradient; gradient nonuniform List<scalar> 24{BRACES};",
    "comments": f"type fixedGradient; // value uniform 3;\n/* ; */ gradient uniform {GRADIENT!r};",
    "other type": f"type myHeatFlux; q uniform 5000; gradient uniform {GRADIENT!r};",
    "mixed, gradient": (
        f"type mixed; refValue uniform 3; refGradient uniform {GRADIENT!r};valueFraction uniform 0;"
    ),
    "mixed, value": (
        "type mixed; refValue nonuniform List<scalar> 24{740}; refGradient uniform 9; "
        "valueFraction uniform 1;"
    ),
    "mixed, both": (
        f"type externalWallHeatFluxTemperature; mode coefficient; h uniform 10; refValue uniform "
        f"700; refGradient uniform {(780 - CELL) / 0.003!r}; valueFraction uniform 0.5;"
    ),
    "value": "type fixedGradient; gradient uniform 5; value uniform 740;",
}


@pytest.mark.parametrize("stated", STATED)
def test_a_wall_with_a_gradient_is_as_hot_as_it_says(tmp_path: Path, stated: str) -> None:
    assert_allclose(at_wall(case_with(tmp_path / "case", STATED[stated])), WALL, rtol=1e-6)


@pytest.mark.parametrize("name", ['"bl.*"', '"(block|other)"'])
def test_a_pattern_names_a_patch_too(tmp_path: Path, name: str) -> None:
    case = case_with(tmp_path / "case", STATED["uniform"], name)
    assert_allclose(at_wall(case), WALL, rtol=1e-6)


def test_each_piece_of_a_decomposed_case_has_its_own_faces(tmp_path: Path) -> None:
    case = case_with(tmp_path / "case", STATED["uniform"], parts=True)
    assert_allclose(at_wall(case), WALL, rtol=1e-6)


def test_binary_lists_may_hold_any_byte(tmp_path: Path) -> None:
    """One of the numbers has the bytes of braces and of a semicolon."""
    odd = np.full(24, GRADIENT)
    raw = odd.tobytes().decode("latin-1")
    text = f"type fixedGradient;\ngradient nonuniform List<scalar> \n24\n({raw});"
    case = case_with(tmp_path / "case", text, form="binary")
    assert_allclose(at_wall(case), WALL, rtol=1e-6)
    braces = np.frombuffer(b"}};;){ ;" * 24, dtype="<f8")
    file = case / "1/T"
    file.write_bytes(file.read_bytes().replace(odd.tobytes(), braces.tobytes()))
    assert_allclose(boundary_entries(file)["block"]["gradient"], braces)
    assert boundary_entries(file)["outside"]["type"] == "fixedValue"


@pytest.mark.parametrize("binary", [False, True])
def test_vectors_beside_a_gradient_are_passed_over(tmp_path: Path, binary: bool) -> None:
    """Solvers list velocities and momenta of patches; in binary they may hold any byte."""
    vectors = np.arange(6.0).reshape(2, 3)
    listed = vectors.tobytes() if binary else b"(0 1 2) (3 4 5)"
    file = tmp_path / "U"
    form = b"binary" if binary else b"ascii"
    file.write_bytes(
        b"FoamFile { format " + form + b"; }\nboundaryField { wall { type calculated; value "
        b"nonuniform List<vector> 2\n(" + listed + b"); } top { type zeroGradient; } }"
    )
    found = boundary_entries(file)
    assert_allclose(found["wall"]["value"], vectors)
    assert found["top"]["type"] == "zeroGradient"


NEITHER = "type externalWallHeatFluxTemperature; mode flux; q uniform 5000;"


def test_a_wall_without_value_and_gradient_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="neither a value nor a gradient of T on the wall block"):
        read_volume(case_with(tmp_path / "case", NEITHER))


def test_another_patch_without_value_and_gradient_is_warned_of(tmp_path: Path) -> None:
    case = case_with(tmp_path / "case", "type zeroGradient;")
    file = case / "1/T"
    text = file.read_text()
    place = text.index("type fixedValue", text.index("outside"))
    file.write_text(text[:place] + "type freestream;\n}\n}\n")
    with pytest.warns(IriftraceWarning, match="on the patch outside .type freestream.; the values"):
        read_volume(case)


def test_a_cold_wall_may_have_the_temperature_of_the_cells(tmp_path: Path) -> None:
    assert_allclose(at_wall(case_with(tmp_path / "case", "type zeroGradient;")), CELL, rtol=1e-6)


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ("type fixedGradient;\ngradient nonuniform List<scalar> 2(1 2);", "lists 2 values for a"),
        ("type fixedGradient;\ngradient nonuniform List<scalar> 24(1 oops);", "cannot be read"),
        ("type fixedGradient; gradient uniform oops;", "neither a value nor a gradient"),
    ],
)
def test_damaged_gradients_are_refused(tmp_path: Path, stated: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read_volume(case_with(tmp_path / "case", stated))

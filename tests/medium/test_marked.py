"""Cells that files mark as hidden, as copies or without a value, and NaN: left out and counted."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.field import read_field
from iriftrace.medium.index_field import IndexField
from validation.inputs.field_grids import AMBIENT, box, saved, solid

CORNER = 0
"""The point at the origin, a corner of one cell of 64 alone."""


def left(path: Path, words: str) -> IndexField:
    """The field that is read, with a warning that has these words."""
    with pytest.warns(IriftraceWarning, match=words):
        return read_field(path)


def assert_right(field: IndexField, volume: float) -> None:
    """T = ambient + 50 x in what is left of 1000 mm3, whose 64 cells have 15.625 mm3 each."""
    assert field.grid.volume == pytest.approx(volume)
    expected = AMBIENT + 50.0 * np.asarray(field.grid.points)[:, 0]
    assert_allclose(field.temperature_k, expected, rtol=1e-6)


@pytest.mark.parametrize("name", ["vtkValidPointMask", "VTKVALIDPOINTMASK"])
@pytest.mark.parametrize("suffix", ["vti", "vtu", "vtk"])
def test_points_that_a_mask_excludes(tmp_path: Path, suffix: str, name: str) -> None:
    grid = solid() if suffix == "vtu" else box()
    mask = np.ones(grid.n_points, dtype=np.int8)
    mask[CORNER] = 0
    grid.point_data[name] = mask
    grid.point_data["T"][CORNER] = 0.0
    path = saved(grid, tmp_path / f"f.{suffix}")
    assert_right(left(path, f"marks 1 of 64 cells as .*{name}.*left out"), 1000.0 - 15.625)


@pytest.mark.parametrize("name", ["vtkValidPointMask", "vtkValidCellMask"])
@pytest.mark.parametrize("value", [0.0, 0.875], ids=["0", "averaged"])
def test_cells_that_a_mask_excludes(tmp_path: Path, name: str, value: float) -> None:
    grid = solid()
    mask = np.ones(grid.n_cells)
    mask[:2] = value
    grid.cell_data[name] = mask
    path = saved(grid, tmp_path / "f.vtu")
    assert_right(left(path, "marks 2 of 64 cells"), 1000.0 - 2 * 15.625)


def test_the_masks_of_a_resampled_field(tmp_path: Path) -> None:
    """Points off a source that ends at x = 7 mm have 0; the cells up to x = 5 mm remain."""
    source = box(size=7.0)
    target = pv.ImageData(dimensions=(5, 5, 5), spacing=(2.5, 1.75, 1.75))
    target = target.sample(source, mark_blank=False)
    path = saved(target, tmp_path / "f.vti")
    assert_right(left(path, "marks 32 of 64 cells"), 5.0 * 7.0 * 7.0)


@pytest.mark.parametrize("suffix", ["vti", "vtu"])
@pytest.mark.parametrize(("flag", "where"), [(32, "cell"), (1, "cell"), (2, "point")])
def test_ghosts(tmp_path: Path, suffix: str, flag: int, where: str) -> None:
    grid = solid() if suffix == "vtu" else box()
    data = grid.cell_data if where == "cell" else grid.point_data
    marks = np.zeros(len(grid.points) if where == "point" else grid.n_cells, dtype=np.uint8)
    marks[CORNER] = flag
    data["vtkGhostType"] = marks
    path = saved(grid, tmp_path / f"f.{suffix}")
    assert_right(left(path, "marks 1 of 64 cells as .*vtkGhostType"), 1000.0 - 15.625)


def test_copies_of_points_have_values(tmp_path: Path) -> None:
    grid = solid()
    grid.point_data["vtkGhostType"] = np.ones(grid.n_points, dtype=np.uint8)
    assert_right(read_field(saved(grid, tmp_path / "f.vtu")), 1000.0)


@pytest.mark.parametrize("suffix", ["vti", "vtu"])
def test_points_without_a_number(tmp_path: Path, suffix: str) -> None:
    grid = solid() if suffix == "vtu" else box()
    grid.point_data["T"][CORNER] = np.nan
    path = saved(grid, tmp_path / f"f.{suffix}")
    field = left(path, r"no number \(NaN\) for 'T' at 1 of 125 points; the 1 cells there are left")
    assert_right(field, 1000.0 - 15.625)


def test_cells_without_a_number(tmp_path: Path) -> None:
    grid = solid()
    grid.cell_data["T"] = np.full(grid.n_cells, AMBIENT)
    grid.cell_data["T"][:3] = np.nan
    grid.point_data.clear()
    path = saved(grid, tmp_path / "f.vtu")
    with pytest.warns(IriftraceWarning, match="given in the cells"):
        field = left(path, r"'T' at 3 of 64 cells; they are left out")
    assert field.grid.volume == pytest.approx(1000.0 - 3 * 15.625)
    assert_allclose(field.temperature_k, AMBIENT)


@pytest.mark.parametrize(
    ("name", "value", "points", "words"),
    [
        (
            "vtkValidPointMask",
            0,
            slice(None),
            "marks all its 64 cells as hidden or without a value",
        ),
        ("T", np.nan, slice(None), "at 125 of 125 points, which leaves no cell"),
        ("T", 1e30, CORNER, r"goes up to .* hotter than any air.*as NaN"),
        ("T", 9999.0, CORNER, r"goes up to .* hotter than any air.*as NaN"),
    ],
)
def test_files_without_any_value_or_with_a_number_for_none_are_refused(
    tmp_path: Path, name: str, value: float, points: int | slice, words: str
) -> None:
    grid = solid()
    values = np.array(grid.point_data["T"])
    values[points] = value
    grid.point_data[name] = values
    with pytest.raises(InputError, match=words):
        read_field(saved(grid, tmp_path / "f.vtu"))

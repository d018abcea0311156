"""Damaged files of VTK: an InputError, and the process lives on."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_array_equal

from iriftrace.core import isolated
from iriftrace.core.errors import InputError
from iriftrace.io import vtk_check as vtk_process
from iriftrace.io import vtk_read as vtk_child
from iriftrace.io.field import read_field
from iriftrace.io.vtk_check import read_file
from validation.inputs.hot_block import air


def test_what_the_child_hands_over_is_what_vtk_reads(tmp_path: Path) -> None:
    faces = np.array(
        ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
    )
    polyhedron = pv.UnstructuredGrid(
        [31, 6, *np.insert(faces, 0, 4, axis=1).ravel()],
        [pv.CellType.POLYHEDRON],
        pv.ImageData(dimensions=(2, 2, 2)).points,
    )
    polyhedron["T"] = np.arange(8.0)
    grids = {
        "cells.vtu": air(4),
        "polyhedron.vtu": polyhedron,
        "sphere.vtp": pv.Sphere(theta_resolution=8, phi_resolution=8),
        "image.vti": _with_values(pv.ImageData(dimensions=(3, 4, 5), origin=(1, 2, 3))),
        "lattice.vtr": _with_values(pv.RectilinearGrid([0.0, 1, 3], [0.0, 2], [0.0, 1, 5])),
    }
    for name, grid in grids.items():
        grid.field_data["field_origin"] = ["synthetic"]
        grid.save(tmp_path / name)
        found, expected = read_file(tmp_path / name), pv.read(tmp_path / name)
        assert type(found) is type(expected)
        assert_array_equal(found.points, expected.points)
        assert found.n_cells == expected.n_cells
        assert found.volume == pytest.approx(expected.volume)
        for array in expected.point_data:
            assert_array_equal(found.point_data[array], expected.point_data[array])
        assert list(found.field_data["field_origin"]) == ["synthetic"]


def _with_values(grid: pv.DataSet) -> pv.DataSet:
    grid["T"] = np.arange(float(grid.n_points))
    return grid


def test_a_reader_that_dies_is_one_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next file is read as if nothing had been."""
    air(30).save(tmp_path / "air.vtu")
    monkeypatch.setattr(isolated, "_SECONDS", -1)
    monkeypatch.setattr(isolated, "_POLL", 0)
    with pytest.raises(
        InputError, match=r"air\.vtu cannot be read \(.*\); check that it is a complete file"
    ):
        read_file(tmp_path / "air.vtu")
    monkeypatch.undo()
    assert read_file(tmp_path / "air.vtu").n_cells == air(30).n_cells


@pytest.mark.parametrize("binary", [True, False], ids=["binary", "text"])
@pytest.mark.parametrize("fraction", [0.5, 0.7, 0.9])
def test_a_file_of_the_old_format_that_was_cut_short(
    tmp_path: Path, binary: bool, fraction: float
) -> None:
    """The whole file is read before, so that its numbers are still in the memory."""
    image, path = pv.ImageData(dimensions=(9, 9, 9)), tmp_path / "air.vtk"
    image["T"] = np.linspace(293.0, 900.0, image.n_points)
    image.save(path, binary=binary)
    content = path.read_bytes()
    assert_array_equal(read_file(path)["T"], pv.read(path)["T"])
    path.write_bytes(content[: int(fraction * len(content))])
    with pytest.raises(InputError, match=r"Error reading (binary|ascii) data.*complete file"):
        read_file(path)


@pytest.mark.parametrize("wrong", [-1, 10**6])
def test_corners_that_do_not_exist(tmp_path: Path, wrong: int) -> None:
    """Before, they ended in an IndexError or in a crash of VTK."""
    (tmp_path / "cell.vtk").write_text(
        "# vtk DataFile Version 3.0\ncell\nASCII\nDATASET UNSTRUCTURED_GRID\n"
        f"POINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 1 5\n4 0 1 2 {wrong}\nCELL_TYPES 1\n10\n"
        "POINT_DATA 4\nSCALARS T float\nLOOKUP_TABLE default\n300 310 320 330\n"
    )
    with pytest.raises(InputError, match="name corners that are not among its"):
        read_field(tmp_path / "cell.vtk")


def test_a_grid_that_is_only_stated(tmp_path: Path) -> None:
    """Ten to the twelfth points in a hundred bytes."""
    (tmp_path / "huge.vti").write_text(
        '<VTKFile type="ImageData"><ImageData WholeExtent="0 9999 0 9999 0 9999" Origin="0 0 0" '
        'Spacing="1 1 1"><Piece Extent="0 9999 0 9999 0 9999"/></ImageData></VTKFile>'
    )
    with pytest.raises(InputError, match="a grid without values"):
        read_field(tmp_path / "huge.vti")


def test_entities_in_a_series_are_refused(tmp_path: Path) -> None:
    (tmp_path / "air.pvd").write_text(
        '<!DOCTYPE a [<!ENTITY b "c">]><VTKFile type="Collection"><Collection/></VTKFile>'
    )
    with pytest.raises(InputError, match="has entities"):
        read_field(tmp_path / "air.pvd")


@pytest.mark.parametrize(("kind", "fits"), [(pv.CellType.TETRA, True), (42, False)])
def test_empty_faces_are_none_where_there_are_no_polyhedra(kind: int, fits: bool) -> None:
    """VTK's reader of .pvtu hands them over at random; a polyhedron needs faces."""
    empty = [np.zeros(1, dtype=np.int64), np.zeros(0)]
    grid = {
        "kind": "unstructured",
        "points": np.eye(4, 3),
        "cells": [[np.array([0, 4]), np.arange(4)]],
        "types": np.array([kind]),
        **{"faces": empty, "face_places": empty},
        **{"point": {}, "cell": {}, "field": {}},
    }
    if fits:
        assert vtk_process._checked(grid).n_cells == 1
        return
    with pytest.raises(vtk_process._Damage, match="faces of its polyhedra"):
        vtk_process._checked(grid)


def test_the_child_needs_no_pyvista() -> None:
    """Importing it would take longer than reading most files."""
    text = Path(vtk_child.__file__).read_text()
    assert "pyvista" not in text.replace("does not import pyvista", "")

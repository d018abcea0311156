"""Ambient air is left out of shells and field files, without a change of what is traced."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_array_equal

from iriftrace.io.field_npz import load_field_file, save_field_file
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.ambient import ambient_step, cells_at, not_ambient
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.path_data import CommonMesh, cells_of, excess_at
from iriftrace.medium.shells.contour import contour_shells
from validation.inputs.shell_fields import field_of, hexahedra

AMBIENT = Air().ambient_refractivity
CONTRAST = 0.7 * AMBIENT


def ball(*, pocket: bool = False) -> IndexField:
    """Hot air within 8 mm of the centre of a box of 40 mm; a cold cavity 15 mm off the centre."""
    grid = hexahedra(24, 20.0)
    if pocket:
        centres = grid.cell_centers().points
        inside = (np.abs(centres - (15.0, 0.0, 0.0)) < 2.0).all(axis=1)
        grid = grid.extract_cells(np.flatnonzero(~inside))
    radius = np.linalg.norm(grid.points, axis=1)
    return field_of(grid, AMBIENT - CONTRAST * np.maximum(1.0 - radius / 8.0, 0.0) ** 2)


def test_gradient_in_the_hot_cells_is_that_of_the_whole_field() -> None:
    field = ball()
    hot = field.hot_air
    assert hot.grid.n_cells < 0.2 * field.grid.n_cells
    # The corners of all cells that are not ambient.
    cells = cells_at(hot.grid, not_ambient(hot.refractivity, AMBIENT))
    corners = np.unique(hot.grid.cell_connectivity.reshape(-1, 8)[cells])
    place = [field.grid.find_closest_point(point) for point in hot.grid.points[corners]]
    assert_array_equal(hot.grid.points[corners], field.grid.points[place])
    np.testing.assert_allclose(
        hot.gradient[corners],
        field.gradient[place],
        rtol=0,
        atol=1e-13 * np.abs(field.gradient).max(),
    )


def test_shells_are_those_of_the_whole_field(monkeypatch: pytest.MonkeyPatch) -> None:
    reduced = contour_shells(ball(), 6).shells
    monkeypatch.setattr("iriftrace.medium.ambient.AMBIENT_SHARE", 0.0)
    whole = contour_shells(ball(), 6).shells
    for one, other in zip(reduced, whole, strict=True):
        assert_array_equal(one.vertices, other.vertices)
        assert_array_equal(one.faces, other.faces)
        # Beyond the neighbours' gradients the two differ by what ambient air would change.
        np.testing.assert_allclose(one.normals, other.normals, atol=1e-4)


def test_a_shell_in_nearly_ambient_air_is_closed() -> None:
    field = ball()
    step = ambient_step(field.refractivity, AMBIENT)
    (shell,) = contour_shells(field, levels=[AMBIENT - 0.1 * step]).shells
    surface = pv.PolyData.from_regular_faces(shell.vertices, shell.faces)
    assert surface.n_open_edges == 0
    assert np.linalg.norm(shell.vertices, axis=1).min() > 7.0


def test_field_file_keeps_hot_cells_and_the_points_of_a_cold_wall(tmp_path: Path) -> None:
    field = ball(pocket=True)
    cells = load_field_file(save_field_file(field, tmp_path / "field.npz"))
    hot = cells_at(field.grid, not_ambient(field.refractivity, AMBIENT))
    assert len(cells.celltypes) == hot.sum() < 0.1 * field.grid.n_cells
    assert cells.wall.sum() == field.wall.n_points > 0
    assert (cells.points[cells.wall][:, 0] > 10.0).all()
    # Each cell has the same values at its corners as before.
    before = field.refractivity[field.grid.cell_connectivity.reshape(-1, 8)[hot]]
    assert_array_equal(cells.refractivity[cells.cell_connectivity.reshape(-1, 8)], before)


def test_field_without_ambient_air_is_kept_whole() -> None:
    field = ball()
    hot = field_of(field.grid, np.full(field.grid.n_points, AMBIENT - CONTRAST))
    assert hot.hot_air is hot
    assert len(cells_of(hot).celltypes) == field.grid.n_cells


def test_fields_whose_hot_air_differs_are_mixed_point_by_point() -> None:
    """Each is ambient in the cells that only the other one has kept."""
    ball_at_0 = ball()
    radius = np.linalg.norm(ball_at_0.grid.points - (5.0, 0.0, 0.0), axis=1)
    excess_at_5 = -CONTRAST * np.maximum(1.0 - radius / 8.0, 0.0)
    aside = field_of(ball_at_0.grid, AMBIENT + excess_at_5)
    cells = [cells_of(one) for one in (ball_at_0, aside)]
    mixed = CommonMesh.of(cells).mixed((1.5, -0.5))
    assert len(mixed.celltypes) > max(len(one.celltypes) for one in cells)
    whole = 1.5 * ball_at_0.refractivity - 0.5 * aside.refractivity
    place = [ball_at_0.grid.find_closest_point(point) for point in mixed.points]
    rounding = 2.0 * ambient_step(ball_at_0.refractivity, AMBIENT)
    np.testing.assert_allclose(mixed.refractivity, whole[place], rtol=0, atol=rounding)
    place = [ball_at_0.grid.find_closest_point(point) for point in cells[0].points]
    found = excess_at(*cells)
    np.testing.assert_allclose(found, excess_at_5[place], rtol=0, atol=rounding)

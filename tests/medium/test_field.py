"""Fields: values, units and origin against what was written, and files that are refused."""

import hashlib
import warnings
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.mesh.transform import parse_transform
from iriftrace.io.field import read_field
from iriftrace.io.reading import ReadField
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.gradient import cell_corners
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.source import FieldSource
from iriftrace.medium.volume import linear_volume
from validation.inputs.field_grids import box, saved, solid

CYLINDER = Path(__file__).parents[2] / "scenes" / "cylinder" / "field.vtu"


def test_coordinates_are_converted_and_then_moved(tmp_path):
    path = saved(solid(), tmp_path / "f.vtu")
    turn = parse_transform("rotate z 90, translate 0 0 5")
    field = read_field(path, ReadField(length_unit="cm", transform=turn))
    assert_allclose(field.grid.bounds, (-100, 0, 0, 100, 5, 105))
    assert field.source.length_unit == "cm"
    # The same change of n over ten times the length, along y instead of x.
    plain = read_field(path).gradient
    assert_allclose(field.gradient[:, 1], plain[:, 0] / 10.0, rtol=1e-9)


@pytest.mark.parametrize(("ambient", "warns"), [(294.15, False), (298.15, True)])
def test_another_ambient_than_the_coolest_air_is_reported(tmp_path, ambient, warns):
    path = saved(box(2), tmp_path / "f.vti")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        field = read_field(path, air=Air(temperature_k=ambient))
    assert field.ambient_refractivity == Air(temperature_k=ambient).ambient_refractivity
    assert bool(caught) == warns
    if warns:
        assert caught[0].category is IriftraceWarning
        assert "has 293.1 K, but the ambient temperature is 298.1 K" in str(caught[0].message)


def test_the_source_names_file_array_and_unit():
    field = read_field(CYLINDER)
    assert field.source.path == str(CYLINDER)
    assert field.source.sha256 == hashlib.sha256(CYLINDER.read_bytes()).hexdigest()
    assert (field.source.array, field.source.quantity) == ("T", "temperature")
    assert field.source.length_unit == "mm"


def test_the_bundled_field_runs_from_room_to_wall_temperature():
    field = read_field(CYLINDER)
    assert field.temperature_k.max() == pytest.approx(1373.15, abs=0.01)
    assert field.temperature_k.min() == pytest.approx(293.15, abs=0.1)
    assert field.hottest_refractivity == pytest.approx(2.718e-4 * 293.15 / 1373.15, rel=1e-5)
    assert field.refractivity.dtype == np.float64


def _sphere_in(path: Path) -> Path:
    pv.Sphere().save(path)
    return path


def _flat(path: Path) -> Path:
    grid = pv.UnstructuredGrid([3, 0, 1, 2], [pv.CellType.TRIANGLE], np.eye(3))
    return saved(grid, path)


def _cut_short(path: Path) -> Path:
    path.write_bytes(CYLINDER.read_bytes()[:20000])
    return path


def _with(values: float | None, name: str = "T"):
    def write(path: Path) -> Path:
        grid = solid(2)
        grid.rename_array("T", name)
        if values is not None:
            grid.point_data[name][3] = values
        return saved(grid, path)

    return write


@pytest.mark.parametrize(
    ("write", "name", "options", "message"),
    [
        (lambda path: path, "none.vtu", {}, "There is no file"),
        (_sphere_in, "f.stl", {}, "not a field file"),
        (_sphere_in, "f.vtk", {}, "no volume cells"),
        (_flat, "f.vtu", {}, "no volume cells"),
        (lambda p: [p.write_text("T 20"), p][1], "f.pvd", {}, "cannot be read"),
        (_cut_short, "f.vtu", {}, "no volume cells|cannot be read"),
        (lambda p: [p.write_text("T 20"), p][1], "f.vtu", {}, "no volume cells|cannot be read"),
        (_with(None, "p"), "f.vtu", {}, "its arrays are p"),
        (_with(None), "f.vtu", {"array": "Q"}, "no array 'Q'.*it has T"),
        (_with(None, "Q"), "f.vtu", {"array": "Q"}, "as `quantity`"),
        (_with(None), "f.vtu", {"quantity": "heat"}, "'heat' is not a quantity"),
        (_with(None), "f.vtu", {"quantity": "density"}, "no array named as density"),
        (_with(np.inf), "f.vtu", {}, "not a finite number at 1 of 27"),
        (_with(-5.0), "f.vtu", {}, "-5 K; it must be positive"),
        (_with(20.0), "f.vtu", {}, "goes down to 20 K.*degC"),
        (_with(0.0, "rho"), "f.vtu", {}, "density of 0 kg/m3"),
        (_with(None), "f.vtu", {"quantity": "index", "array": "T"}, "neither an index"),
        (_with(None), "f.vtu", {"temperature_unit": "mm"}, "cannot be converted"),
        (_with(None), "f.vtu", {"length_unit": "ell"}, "not a length unit"),
    ],
)
def test_wrong_files_are_refused_in_one_sentence(tmp_path, write, name, options, message):
    path = write(tmp_path / name)
    with pytest.raises(InputError, match=message):
        read_field(path, ReadField(**options))


def test_sampling_is_exact_where_the_field_is_linear(tmp_path):
    grid = solid()
    refractivity = 2e-4 + 1e-6 * grid.points @ [1.0, -2.0, 3.0] + 1e-4
    field = _field(grid, refractivity)
    points = np.random.default_rng(2).uniform(0.0, 10.0, (50, 3))
    expected = 3e-4 + 1e-6 * points @ [1.0, -2.0, 3.0]
    assert_allclose(field.sample(points), expected, rtol=1e-6)
    outside = field.sample([[-1.0, 5.0, 5.0], [5.0, 5.0, 5.0], [5.0, 5.0, 99.0]])
    assert_array_equal(np.isnan(outside), [True, False, True])


def test_a_field_does_not_touch_the_grid_it_was_made_from():
    grid = pv.UnstructuredGrid(solid(1).triangulate())
    field = _field(grid, np.full(grid.n_points, 2e-4))
    assert grid.array_names == ["T"]
    assert field.grid.array_names == ["refractivity"]


def test_fields_that_do_not_fit_together_are_refused():
    grid = solid(1)
    source = FieldSource("", "", "", "index", "mm")
    with pytest.raises(InputError, match="3 refractivities for 8 points"):
        IndexField(grid.triangulate(), np.ones(3), Air(), source)
    with pytest.raises(InputError, match="linear_volume"):
        IndexField(grid, np.ones(8), Air(), source)


def _field(grid: pv.UnstructuredGrid, refractivity: np.ndarray) -> IndexField:
    volume = linear_volume(grid)
    return IndexField(volume, refractivity, Air(), FieldSource("", "", "", "index", "mm"))


def test_values_within_cells_come_from_these_cells():
    """Between the corners of real tetrahedra, in no order that would keep VTK in one cell."""
    field = read_field(CYLINDER)
    corners = cell_corners(field.grid)[10][1]
    rng = np.random.default_rng(0)
    weights = rng.dirichlet(np.full(4, 0.5), len(corners))
    order = rng.permutation(len(corners))
    points = np.asarray(field.grid.points, dtype=np.float64)
    places = np.einsum("ij,ijk->ik", weights, points[corners])[order]
    expected = (weights * field.refractivity[corners]).sum(axis=1)[order]
    # Places on faces may be looked up in a neighbour whose bent face passes a little beside them.
    assert_allclose(field.sample(places), expected, rtol=0.0, atol=1e-7)

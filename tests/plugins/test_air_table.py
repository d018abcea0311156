"""A field's table in Dr.Jit against NumPy's, and the parameters of gradient_path."""

from pathlib import Path
from typing import Any

import mitsuba as mi
import numpy as np
import pytest
from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.io.field_npz import load_field_file, save_field_file
from iriftrace.medium.gradient import consistent_gradient, point_gradient
from iriftrace.medium.path_data import FieldCells
from iriftrace.medium.tetrahedra import tetrahedra_of
from iriftrace.plugins.kernels.air_table import COLUMNS, AirTable
from iriftrace.scenes import folder_of
from validation.inputs.shell_fields import sphere_field

pytestmark = pytest.mark.usefixtures("variant")


@pytest.fixture(scope="module")
def field(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Hexahedra of air that is hottest in the middle; ambient far outside."""
    path = tmp_path_factory.mktemp("field") / "field.npz"
    save_field_file(sphere_field(10), path)
    return path


@pytest.fixture
def integrator(field: Path) -> Any:
    return mi.load_dict({"type": "gradient_path", "field": str(field)})


def table_of(cells: FieldCells) -> np.ndarray:
    """Rows of the table that a new integrator makes of cells, by NumPy."""
    integrator: Any = mi.load_dict({"type": "gradient_path"})
    integrator.use(cells)
    return np.array(integrator.air.points).reshape(-1, COLUMNS)


def off(found: np.ndarray, expected: np.ndarray) -> float:
    """Largest difference of two tables, relative to the largest entry of its column."""
    largest = np.abs(expected).max(axis=0)
    return float((np.abs(found - expected) / np.where(largest > 0, largest, 1)).max())


def temperature_of(cells: FieldCells) -> np.ndarray:
    return cells.air.temperature(cells.refractivity)


@pytest.mark.parametrize("scene", ["cylinder", "hot_plate"])
def test_index_and_recovered_gradient_are_those_of_numpy(scene: str) -> None:
    """To 1e-12 of the largest gradient; the cylinder has cells of all four types."""
    cells = load_field_file(folder_of(scene) / "field.npz")
    corners = tetrahedra_of(cells).corners
    table = AirTable(cells, corners)
    excess = table.excess(mi.Float64(temperature_of(cells)), mi.Float64(1.0))
    found = np.array(table.gradient(excess)).T
    recovered = point_gradient(cells, cells.refractivity)
    expected = consistent_gradient(cells.points, corners, cells.refractivity, recovered)
    assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()
    difference = np.array(excess) - (cells.refractivity - cells.ambient)
    assert np.abs(difference).max() < 1e-12 * cells.ambient


def test_another_temperature_makes_the_table_of_a_field_with_it(integrator: Any) -> None:
    """And so does a contrast; tetrahedra and their boundary stay."""
    cells, tetrahedra = integrator.air.cells, integrator.air.tetrahedra
    kelvin = temperature_of(cells)
    warmer = kelvin + 0.05 * (kelvin - cells.air.temperature_k) * np.sin(cells.points[:, 0])
    parameters = mi.traverse(integrator)
    assert parameters.flags("field.temperature") == mi.ParamFlags.Differentiable
    parameters["field.temperature"] = mi.Float64(warmer)
    parameters["field.contrast"] = mi.Float64(1.25)
    parameters.update()
    excess = 1.25 * (cells.air.refractivity(warmer) - cells.ambient)
    expected = table_of(evolve(cells, refractivity=cells.ambient + excess))
    found = np.array(integrator.air.points).reshape(-1, COLUMNS)
    assert off(found, expected) < 1e-7
    assert np.abs(excess).max() > 1e-6
    assert integrator.air.tetrahedra is tetrahedra
    np.testing.assert_allclose(integrator.air.cells.refractivity, cells.ambient + excess)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([300.0] * 3, "field.temperature has 3 values, but the field has [0-9,]+ points"),
        (-1.0, "temperature of -1 K does not exist in air"),
    ],
)
def test_temperatures_that_no_field_has_are_refused(
    integrator: Any, values: list[float] | float, message: str
) -> None:
    parameters, count = mi.traverse(integrator), len(integrator.air.cells.points)
    given = [values] * count if isinstance(values, float) else values
    parameters["field.temperature"] = mi.Float64(given)
    with pytest.raises(InputError, match=message):
        parameters.update()

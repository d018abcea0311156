"""Velocities in files of several programs: values in m/s against those written, turned along."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from iriftrace.core.mesh.transform import parse_transform
from iriftrace.io.field import read_field
from iriftrace.io.reading import ReadField
from iriftrace.medium.flow import AirFlow, velocity_arrays
from validation.field_files import comsol
from validation.inputs import hot_block
from validation.inputs.field_grids import AMBIENT, box, saved

VELOCITY = np.column_stack((np.asarray(box().points)[:, ::-1] * 0.01, box().points[:, 0]))[:, :3]


def grid_with(*names: str) -> pv.UnstructuredGrid:
    """A box with one vector array, or with three arrays of numbers along x, y and z."""
    grid = box().cast_to_unstructured_grid()
    if len(names) == 1:
        grid.point_data[names[0]] = VELOCITY
    else:
        for name, column in zip(names, VELOCITY.T, strict=True):
            grid.point_data[name] = np.ascontiguousarray(column)
    return grid


def flow_of(path: Path, **options: object) -> AirFlow:
    flow = read_field(path, flow=True, reading=ReadField(**options)).flow
    assert flow is not None
    return flow


@pytest.mark.parametrize(
    ("names", "factor"),
    [
        (("U",), 1.0),
        (("UMean",), 1.0),
        (("Velocity",), 1.0),
        (("Velocity_field",), 1.0),
        (("velocity [mm/s]",), 1e-3),
        (("Velocity_(km/h)",), 1 / 3.6),
        (("u", "v", "w"), 1.0),
        (("comp1.u (m/s)", "comp1.v (m/s)", "comp1.w (m/s)"), 1.0),
        (tuple(f"Velocity field, {a} component (m/s)" for a in "xyz"), 1.0),
        (tuple(f"Velocity_field,_{a}-component_(mm/s)" for a in "xyz"), 1e-3),
        (("velocity_x", "velocity_y", "velocity_z"), 1.0),
        (("x-velocity", "y-velocity", "z-velocity"), 1.0),
        (("Velocity u", "Velocity v", "Velocity w"), 1.0),
        (("Ux", "Uy", "Uz"), 1.0),
    ],
)
def test_names_of_velocities(tmp_path: Path, names: tuple[str, ...], factor: float) -> None:
    """The temperature is found beside them as before."""
    path = saved(grid_with(*names), tmp_path / "f.vtu")
    field = read_field(path, flow=True)
    assert field.source.array == "T"
    assert field.flow.velocity == pytest.approx(factor * VELOCITY)
    assert field.flow.missing == ""
    assert read_field(path).flow is None


@pytest.mark.parametrize(
    ("names", "words"),
    [
        (("displacement",), "the file has no velocities"),
        (("u (mm)", "v (mm)", "w (mm)"), "the unit of u (mm), v (mm), w (mm) is not a velocity"),
        (("u (m/s)", "v (m/s)", "w (mm/s)"), "is not a velocity"),
        (("grad_x", "grad_y", "grad_z"), "the file has no velocities"),
        (("u_rms",), "the file has no velocities"),
    ],
)
def test_what_is_no_velocity(tmp_path: Path, names: tuple[str, ...], words: str) -> None:
    flow = flow_of(saved(grid_with(*names), tmp_path / "f.vtu"))
    assert flow.velocity is None
    assert words in flow.missing


@pytest.mark.parametrize(
    ("arrays", "words"),
    [
        ({"U": 2}, "U has 2 components, 3 are needed"),
        ({"UMean": 9}, "UMean has 9 components, 3 are needed"),
        ({"U": 1}, "U has 1 component, 3 are needed"),
        ({"u": 1, "v": 1}, "it has only u and v of 3 components"),
        (
            {"comp1.u (m/s)": 1, "comp1.w (m/s)": 1, "U": 1},
            "it has only comp1.u (m/s) and comp1.w (m/s) of 3 components",
        ),
        ({"Uz": 1}, "it has only Uz of 3 components"),
        ({"u (mm)": 1, "v (mm)": 1}, "the file has no velocities"),
        ({"w": 1}, "the file has no velocities"),
    ],
)
def test_half_a_velocity_says_what_it_lacks(arrays: dict[str, int], words: str) -> None:
    grid = box().cast_to_unstructured_grid()
    for name, width in arrays.items():
        grid.point_data[name] = np.ones((grid.n_points, width)[: 1 + (width > 1)])
    assert velocity_arrays(grid, None) == (None, words)


def test_gaps_in_velocities_are_counted(tmp_path: Path) -> None:
    grid = grid_with("U")
    grid.point_data["U"][[1, 4, 5], [0, 1, 2]] = np.nan
    flow = flow_of(saved(grid, tmp_path / "f.vtu"))
    assert flow.missing == (
        f"U is not finite at 3 of {grid.n_points} points; export it without gaps"
    )


def test_magnitude_alone_is_none(tmp_path: Path) -> None:
    """COMSOL calls it U; it has no direction."""
    grid = box().cast_to_unstructured_grid()
    grid.point_data["spf.U (m/s)"] = np.ones(grid.n_points)
    assert flow_of(saved(grid, tmp_path / "f.vtu")).velocity is None


def test_average_goes_with_average() -> None:
    grid = grid_with("U")
    grid.point_data["UMean"] = 2.0 * VELOCITY
    assert velocity_arrays(grid, None)[0].names == ("U",)
    assert velocity_arrays(grid, None, averaged=True)[0].names == ("UMean",)


def test_usual_vector_wins_over_components() -> None:
    grid = grid_with("u", "v", "w")
    grid.point_data["Velocity"] = VELOCITY
    assert velocity_arrays(grid, None)[0].names == ("Velocity",)


@pytest.mark.parametrize(("unit", "factor"), [("m/s", 1.0), ("mm/s", 1e-3)])
def test_columns_of_comsols_text(tmp_path: Path, unit: str, factor: float) -> None:
    points = np.asarray(box().points, dtype=np.float64)
    columns = {"T (K)": AMBIENT + 50.0 * points[:, 0]}
    columns |= {f"{n} ({unit})": c for n, c in zip("uvw", VELOCITY.T, strict=True)}
    comsol.grid(tmp_path / "f.txt", [np.unique(axis) for axis in points.T], columns)
    assert flow_of(tmp_path / "f.txt").velocity == pytest.approx(factor * VELOCITY)


def test_values_in_cells_are_averaged_onto_points(tmp_path: Path) -> None:
    grid = hot_block.air(6)
    grid.cell_data["U"] = np.tile((0.1, -0.2, 0.3), (grid.n_cells, 1))
    flow = flow_of(saved(grid, tmp_path / "f.vtu"))
    assert flow.velocity == pytest.approx(np.tile((0.1, -0.2, 0.3), (grid.n_points, 1)))


def test_velocities_turn_with_the_field_and_keep_their_length(tmp_path: Path) -> None:
    """x goes to y and y to -x under a quarter turn about z; scaling is one of lengths alone."""
    path = saved(grid_with("U"), tmp_path / "f.vtu")
    turned = flow_of(path, transform=parse_transform("rotate z 90, scale 2"))
    expected = VELOCITY[:, (1, 0, 2)] * (-1.0, 1.0, 1.0)
    assert turned.velocity == pytest.approx(expected, abs=1e-12)
    mirrored = flow_of(path, transform=parse_transform("scale 1 1 -1"))
    assert mirrored.velocity == pytest.approx(VELOCITY * (1.0, 1.0, -1.0))
    stretched = flow_of(path, transform=parse_transform("scale 1 1 3"))
    assert stretched.velocity is None
    assert "distorts" in stretched.missing

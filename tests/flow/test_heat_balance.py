"""The heat that leaves with the air, against closed forms."""

import json
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from attrs import evolve
from numpy.typing import NDArray

from iriftrace.cli import main
from iriftrace.flow.check.check import check_field
from iriftrace.flow.check.heat_balance import HeatBalance, heat_balance
from iriftrace.flow.simulate.part_surface import mirrored_grid
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.medium.air import thermophysics as gas
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.flow import ENTHALPY_FLUX, HEAT_STORAGE, AirFlow, carried_heat
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.origin import WALL_HEAT
from iriftrace.medium.source import FieldFacts, FieldKind, FieldSource
from validation.inputs import hot_block
from validation.inputs.conducting_sphere import RADIUS, ROOM, WALL, conducting_sphere, finding
from validation.inputs.hot_block import HALF, OUTER

FloatArray = NDArray[np.float64]

SOURCE = FieldSource("air", "0" * 64, "T", "temperature", "mm")
PRESSURE = 101325.0


def points_of(grid: pv.UnstructuredGrid) -> FloatArray:
    return np.asarray(grid.points, dtype=np.float64)


def balance(grid: pv.UnstructuredGrid, kelvin: FloatArray, flow: AirFlow) -> HeatBalance:
    found = heat_balance(IndexField(grid, Air().refractivity(kelvin), Air(), SOURCE, flow))
    assert found is not None
    return found


def column(grid: pv.UnstructuredGrid) -> FloatArray:
    """A hot column above the block, whose heat content falls linearly to its edges along x and y.

    It begins at the block, so that all of it is heated within every surface around the block.
    """
    x, y, z = points_of(grid).T
    share = np.maximum(1 - np.abs(x) / HALF, 0) * np.maximum(1 - np.abs(y) / HALF, 0)
    wanted = np.where(z >= HALF - 1e-6, share, 0.0) * gas.heat_content(1000.0, ROOM, PRESSURE)
    knots = np.linspace(ROOM, 1000.0, 5000)
    return np.interp(wanted, gas.heat_content(knots, ROOM, PRESSURE), knots)


def rising(grid: pv.UnstructuredGrid, speed: float) -> FloatArray:
    return np.tile((0.0, 0.0, speed), (grid.n_points, 1))


def test_hot_column_carries_its_heat_content_times_speed() -> None:
    """Over the block's 12 mm squared the mean content is a quarter of that in the middle: Q = U
    f(1000 K) (12 mm)^2 / 4, here 5.2 W, through near and far surfaces alike. The cells of 1 mm are
    twelve to the column's width.
    """
    grid = hot_block.air(36)
    found = balance(grid, column(grid), AirFlow(rising(grid, 0.7)))
    content = float(gas.heat_content(1000.0, ROOM, PRESSURE))
    expected = 0.7 * content * (2 * HALF * 1e-3) ** 2 / 4
    assert found.carried_w == pytest.approx(expected, rel=0.01)
    assert np.isnan(found.stored_w)
    assert not found.own_flux
    passing = np.array(found.through_zones_w) - found.conducted_w
    assert passing == pytest.approx(expected, rel=0.03)


def test_air_of_one_temperature_carries_nothing_in_all() -> None:
    """Room air brings nothing at all; hot air as much on one side as it takes on the other."""
    grid = hot_block.air()
    flow = AirFlow(np.tile((0.3, -0.5, 0.7), (grid.n_points, 1)))
    assert balance(grid, np.full(grid.n_points, ROOM), flow).carried_w == pytest.approx(0, abs=1e-9)
    hot = balance(grid, np.full(grid.n_points, 900.0), flow)
    through_one_side = (
        0.7 * float(gas.heat_content(900.0, ROOM, PRESSURE)) * (2 * OUTER * 1e-3) ** 2
    )
    assert through_one_side > 100.0
    assert abs(hot.leaving_w) < 1e-9 * through_one_side


def test_heat_of_a_sphere_is_conducted_through_the_air() -> None:
    """Q = 4 pi R Phi, of air at rest whose conductivity's integral falls as Phi R / r.

    Cells of 1 mm are a sixth of the sphere's radius.
    """
    field, _ = conducting_sphere(1.0)
    radius = np.linalg.norm(points_of(field.grid), axis=1)
    knots = np.linspace(ROOM, WALL, 4000)
    steps = 0.5 * np.diff(knots) * (gas.conductivity(knots[1:]) + gas.conductivity(knots[:-1]))
    potential = np.concatenate(([0.0], np.cumsum(steps)))
    share = np.minimum(RADIUS / radius, 1.0)
    kelvin = np.interp(share * potential[-1], potential, knots)
    found = balance(field.grid, kelvin, AirFlow(np.zeros((len(radius), 3))))
    expected = 4 * np.pi * RADIUS * 1e-3 * potential[-1]
    assert found.carried_w == 0.0
    assert found.through_zones_w == pytest.approx(np.full(3, expected), rel=0.03)


def test_stored_heat_makes_up_for_the_difference_between_surfaces() -> None:
    """Air that takes up S everywhere lets less heat pass the farther out: q = C/r^2 - S r/3.

    Flux through a surface plus S times the volume within is 4 pi C - S 4/3 pi R^3 for all of them.
    """
    field, _ = conducting_sphere(1.0)
    points = points_of(field.grid)
    radius = np.linalg.norm(points, axis=1, keepdims=True)
    strength, rate = 0.4, 2e5  # W, W/m3
    metres = radius * 1e-3
    flux = (strength / metres**2 - rate * metres / 3) * points / radius
    uniform = np.full(len(points), ROOM)
    storage = np.full(len(points), rate)
    found = balance(field.grid, uniform, AirFlow(np.zeros_like(flux), flux, storage))
    expected = 4 * np.pi * (strength - rate * (RADIUS * 1e-3) ** 3 / 3)
    assert found.own_flux
    assert found.stored_w > 0.2 * expected
    assert found.through_zones_w == pytest.approx(np.full(3, expected), rel=0.02)
    assert found.leaving_w == pytest.approx(expected, rel=0.02)


def test_mirrored_quarter_has_the_balance_of_the_whole() -> None:
    """Of a plume that leaves the column on all sides; the vectors are those of the whole."""
    whole = hot_block.air(36)
    x, y, _ = points_of(whole).T
    velocity = np.stack((0.02 * x, 0.01 * y, np.full(len(x), 0.5)), axis=1)
    whole.point_data["T"] = column(whole)
    whole.point_data["U"] = velocity
    centres = np.asarray(whole.cell_centers().points)
    quarter = whole.extract_cells(np.flatnonzero((centres[:, :2] > 0).all(axis=1)))
    # As a solver's means of the cells on one side leave it.
    quarter.point_data["U"][:, 0] += 1e-3
    quarter.point_data["U"][:, 1] += 1e-3
    joined = mirrored_grid(mirrored_grid(quarter, 0, 0.0), 1, 0.0)
    place = points_of(joined)
    expected = np.stack((0.02 * place[:, 0], 0.01 * place[:, 1]), axis=1)
    expected += np.sign(place[:, :2]) * 1e-3
    assert np.asarray(joined["U"])[:, :2] == pytest.approx(expected, abs=1e-9)
    joined["U"][:, :2] -= np.sign(place[:, :2]) * 1e-3
    one, other = (
        balance(grid, np.asarray(grid["T"], dtype=np.float64), AirFlow(np.asarray(grid["U"])))
        for grid in (whole, joined)
    )
    # Cells split into tetrahedra along other diagonals.
    assert other.carried_w == pytest.approx(one.carried_w, rel=0.01)
    assert other.conducted_w == pytest.approx(one.conducted_w, abs=0.01 * one.carried_w)


def test_average_of_the_flux_follows_from_three_averages() -> None:
    """Two equally long states, cool and slow, hot and fast: the product of the averages is 6 % too
    small, the formula with the average of rho U 0.3 %.
    """
    kelvin = np.array([[650.0], [850.0]])
    speed = np.array([[0.2], [0.9]])
    rho = gas.density(kelvin, PRESSURE)
    content = gas.heat_content(kelvin, ROOM, PRESSURE)
    exact = float((content * speed).mean())
    mean_rho, mean_speed = rho.mean(axis=0), speed.mean(axis=0)[:, None] * np.eye(3)[2]
    momentum = (rho * speed).mean(axis=0)[:, None] * np.eye(3)[2]
    flux = carried_heat(mean_rho, mean_speed, momentum, ROOM, PRESSURE)
    assert flux[0, :2] == pytest.approx(0.0)
    assert flux[0, 2] == pytest.approx(exact, rel=3e-3)
    product = carried_heat(mean_rho, mean_speed, mean_rho[:, None] * mean_speed, ROOM, PRESSURE)
    assert product[0, 2] / exact - 1 == pytest.approx(-0.06, abs=0.005)


def saved(folder: Path, **arrays: FloatArray) -> IndexField:
    """The hot block with more arrays in its file."""
    field, _ = hot_block.save(folder)
    grid = pv.read(field)
    for name, values in arrays.items():
        grid.point_data[name] = values.astype(np.float32)
    grid.save(field)
    return read_field(field, flow=True)


def test_field_without_velocities_says_how_to_get_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    check = check_field(saved(tmp_path), read_part(tmp_path / "block.stl"))
    found = finding(check, "heat balance")
    assert found["verdict"] == "-"
    assert found["conducted_w"] == finding(check, "heat from the wall")["heat_w"]
    assert "needs velocities: the file has no velocities" in found["remark"]
    assert "field simulate" in found["remark"]
    capsys.readouterr()
    words = ["field", "check", str(tmp_path / "air.vtu"), str(tmp_path / "block.stl")]
    assert main(words) == 0
    printed = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "the file has no velocities" in printed


def test_verdict_follows_the_heat_that_the_solver_counted(tmp_path: Path) -> None:
    """The file's own flux is used, and the new arrays are not taken for a temperature."""
    grid = hot_block.air()
    points = points_of(grid)
    radius = np.linalg.norm(points, axis=1, keepdims=True)
    flux = 3.0 / (radius * 1e-3) ** 2 * points / radius
    velocity = np.zeros_like(flux)
    storage = np.zeros(len(points))
    field = saved(tmp_path, U=velocity, **{ENTHALPY_FLUX: flux, HEAT_STORAGE: storage})
    assert field.source.array == "T"
    part = read_part(tmp_path / "block.stl")
    leaving = heat_balance(field).leaving_w
    assert heat_balance(field).carried_w == pytest.approx(4 * np.pi * 3.0, rel=0.02)
    for share, verdict in ((1.0, "good"), (1.08, "doubtful"), (0.92, "doubtful"), (1.2, "bad")):
        source = evolve(field.source, wall_heat_w=leaving / share)
        found = finding(check_field(evolve(field, source=source), part), "heat balance")
        assert found["verdict"] == verdict
        assert found["off"] == pytest.approx(share - 1)
        assert found["own_flux"]


@pytest.mark.parametrize(
    ("factor", "name", "verdict", "hint"),
    [
        (1.0, "U", "good", ""),
        (1.4, "U", "doubtful", ""),
        (120.0, "U", "bad", "are they mm/s?"),
        (1.0, "U (mm/s)", "bad", "are they m/s?"),
        (4.0, "U", "bad", ""),
        (0.0, "U", "bad", ""),
        (-1.0, "U", "bad", ""),
    ],
)
def test_wrong_velocities_are_bad_though_storage_is_unknown(
    tmp_path: Path, factor: float, name: str, verdict: str, hint: str
) -> None:
    """A column whose heat is the solver's count; then its speed is wrong."""
    grid = hot_block.air()
    kelvin, speed = column(grid), rising(grid, 0.7)
    leaving = balance(grid, kelvin, AirFlow(speed)).leaving_w
    field = saved(tmp_path, T=kelvin, **{name: factor * speed})
    field = evolve(field, source=evolve(field.source, wall_heat_w=leaving))
    check = check_field(field, read_part(tmp_path / "block.stl"))
    found = finding(check, "heat balance")
    assert found["verdict"] == verdict
    assert (found["read_from"], found["read_in"]) == (name, "mm/s" if "mm" in name else "m/s")
    said = found["remark"]
    fastest = 0.7 * abs(factor) * (1e-3 if "mm" in name else 1.0)
    assert f"velocities of {name} read as {found['read_in']}, up to {fastest:.3g} m/s" in said
    assert ("are they" in said) == bool(hint)
    assert hint in said


def test_nothing_is_stored_in_a_steady_field(tmp_path: Path) -> None:
    """So the bound is that of a known storage, by what the user or the field says."""
    grid = hot_block.air()
    kelvin, speed = column(grid), rising(grid, 0.7)
    leaving = balance(grid, kelvin, AirFlow(speed)).leaving_w
    field = saved(tmp_path, T=kelvin, U=1.4 * speed)
    part = read_part(tmp_path / "block.stl")

    def judged(kind: FieldKind, steady: bool | None) -> tuple[str, str]:
        source = evolve(field.source, wall_heat_w=leaving, facts=FieldFacts(kind))
        check = check_field(evolve(field, source=source), part, steady=steady)
        found = finding(check, "heat balance")
        return found["verdict"], found["remark"]

    for kind, steady in ((FieldKind.NOT_STATED, True), (FieldKind.STEADY, None)):
        verdict, said = judged(kind, steady)
        assert verdict == "bad"
        assert "stored nothing, as the field is steady" in said
        assert "unknown" not in said
    for kind, steady in ((FieldKind.UNSTEADY, None), (FieldKind.STEADY, False)):
        verdict, said = judged(kind, steady)
        assert verdict == "doubtful"
        assert "stored unknown" in said
    files = [str(tmp_path / name) for name in ("air.vtu", "block.stl")]
    options = ["--field-time", "steady", "-o", str(tmp_path / "check.json")]
    assert main(["field", "check", *files, *options]) == 0
    written = json.loads((tmp_path / "check.json").read_text())
    (found,) = (f for f in written["findings"] if f["name"] == "heat balance")
    assert found["numbers"]["steady"] is True
    assert written["verdict"] == "bad"  # and the exit status is 0 all the same


def test_counted_heat_is_found_in_the_blocks_of_a_series(tmp_path: Path) -> None:
    grid = hot_block.air()
    grid.field_data[WALL_HEAT] = [12.5]
    grid.save(tmp_path / "state.vtu")
    (tmp_path / "f.pvd").write_text(
        '<VTKFile type="Collection" version="0.1"><Collection>'
        '<DataSet timestep="0.5" part="0" file="state.vtu"/></Collection></VTKFile>'
    )
    assert read_field(tmp_path / "f.pvd").source.wall_heat_w == 12.5


def test_half_a_field_has_no_surface_around_the_part(tmp_path: Path) -> None:
    _, part = hot_block.save(tmp_path)
    grid = hot_block.air()
    grid.point_data["U"] = rising(grid, 0.1)
    hot_block.half(grid).save(tmp_path / "half.vtu")
    check = check_field(read_field(tmp_path / "half.vtu", flow=True), read_part(part))
    assert finding(check, "heat balance")["verdict"] == "-"
    assert "off" not in finding(check, "heat balance")


def test_enthalpy_belongs_to_the_heat_capacity() -> None:
    """Its derivative; that of the heat content over the density; air at 300 K has 1005 J/(kg K)."""
    kelvin = np.array([250.0, 300.0, 700.0, 999.0, 1001.0, 1373.15])
    step = 0.01
    slope = (gas.enthalpy(kelvin + step) - gas.enthalpy(kelvin - step)) / (2 * step)
    assert slope == pytest.approx(gas.heat_capacity(kelvin), rel=1e-6)
    assert gas.enthalpy(301.0) - gas.enthalpy(300.0) == pytest.approx(1008.0, rel=5e-3)
    assert gas.enthalpy(1000.0) == pytest.approx(gas.enthalpy(1000.0 - 1e-9), rel=1e-4)
    content = [gas.heat_content(kelvin + s, ROOM, PRESSURE) for s in (step, -step)]
    density = [gas.density(kelvin + s, PRESSURE) for s in (step, -step)]
    ratio = (content[0] - content[1]) / (density[0] - density[1])
    assert gas.heat_content_slope(kelvin, ROOM) == pytest.approx(ratio, rel=1e-5)

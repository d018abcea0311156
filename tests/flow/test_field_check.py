"""Checks of fields against closed forms, a simulation and spoilt copies of it."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import trimesh
from attrs import evolve
from numpy.testing import assert_allclose

from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.flow.check.check import check_field
from iriftrace.flow.check.finding import FieldCheck, share_through_open_sides
from iriftrace.flow.check.nusselt import horizontal_cylinder_diameter
from iriftrace.flow.check.wall import gradient_errors, wall_state
from iriftrace.flow.simulate.bodies import Body, write_bodies
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.io.reading import ReadPart
from iriftrace.medium.air import thermophysics as gas
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.origin import state_origin
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.source import FieldFacts, FieldSource
from iriftrace.part.part import Part
from iriftrace.scenes import folder_of
from validation.inputs import hot_block
from validation.inputs.conducting_sphere import (
    OUTER,
    RADIUS,
    ROOM,
    WALL,
    conducting_sphere,
    finding,
)
from validation.inputs.parts import gear, part_from
from validation.inputs.solved_fields import DATA

CYLINDER_A = DATA / "cylinder_A.vtu"

Checked = tuple[IndexField, FieldCheck]


@pytest.fixture(scope="module")
def cylinder() -> Part:
    return read_part(folder_of("cylinder") / "part.ply")


@pytest.fixture(scope="module")
def simulated(cylinder: Part) -> Checked:
    """The bundled field, a simulation that is still coarser than the one for the rule."""
    field = read_field(folder_of("cylinder") / "field.vtu")
    return field, check_field(field, cylinder, camera=(0, 0, 400.0))


def test_heat_of_a_sphere_is_that_of_conduction() -> None:
    """Q = 4 pi (Phi_wall - Phi_room) / (1/R - 1/R_outer); cells of 1 mm at R = 6 mm are 4 % off.

    The mean gradient of the wall's cells is that of a place half a cell above it, 12 % off.
    """
    field, part = conducting_sphere(1.0)
    wall = wall_state(field, part)
    knots = np.linspace(ROOM, WALL, 4000)
    potential = np.trapezoid(gas.conductivity(knots), knots)
    expected = 4 * np.pi * potential / (1 / RADIUS - 1 / OUTER) * 1e-3
    assert wall.heat_w == pytest.approx(expected, rel=0.05)
    of_cells = np.sum(wall.flux_of_cells * wall.areas) * 1e-6
    assert of_cells == pytest.approx(0.88 * expected, rel=0.02)
    assert wall.area_mm2 == pytest.approx(4 * np.pi * RADIUS**2, rel=0.01)
    assert_allclose(wall.temperature_k, WALL)
    # dT/dr at the wall = (Phi_wall / k_wall) / (R (1 - R/R_outer)), so the layer is known too.
    fall = potential / gas.conductivity(WALL) / RADIUS / (1 - RADIUS / OUTER)
    assert np.nanmedian(wall.layer_mm) == pytest.approx((WALL - ROOM) / fall, rel=0.05)


def test_simulation_agrees_with_the_rule_and_itself(cylinder: Part) -> None:
    """Of natural convection around a horizontal cylinder, on a coarse mesh.

    On two finer ones of the same case Nu is 6.63 and 6.60, and from the mean of the wall's cells
    6.27 and 6.35: the truth lies between.
    """
    check = check_field(read_field(CYLINDER_A), cylinder, wall_temperature_k=WALL)
    nusselt = finding(check, "Nusselt number")
    assert nusselt["rule"] == pytest.approx(5.90, abs=0.01)
    assert nusselt["nusselt_of_cells"] < 6.5 < nusselt["nusselt"]
    assert nusselt["nusselt_of_cells"] == pytest.approx(6.23, abs=0.05)
    assert nusselt["nusselt"] == pytest.approx(6.80, abs=0.05)
    assert nusselt["expected_ratios"] == pytest.approx((1.0, 0.90, 0.28), abs=0.005)
    assert nusselt["ratios"] == pytest.approx(nusselt["expected_ratios"], rel=0.1)
    assert nusselt["verdict"] == "good"
    assert nusselt["diameter_mm"] == pytest.approx(27.0, abs=0.05)
    heat = finding(check, "heat from the wall")
    assert heat["heat_w"] == pytest.approx(272.0, rel=0.06)
    assert heat["verdict"] == "-"
    gradient = finding(check, "gradient")
    assert gradient["verdict"] == "good"
    assert gradient["lines"] > 300
    assert finding(check, "coolest air")["verdict"] == "good"
    assert finding(check, "field's wall to part")["verdict"] == "good"
    wall = finding(check, "wall temperature")
    assert wall["median_k"] == pytest.approx(WALL, abs=0.1)
    assert finding(check, "boundary layer")["layer_mm"] == pytest.approx(4.5, abs=0.2)


def test_heat_that_the_solver_counted_is_preferred(simulated: Checked, cylinder: Part) -> None:
    """The gradient says how it is spread, the file's own number how much it is."""
    field, check = simulated
    by_gradient = finding(check, "heat from the wall")["heat_w"]
    source = evolve(field.source, wall_heat_w=0.95 * by_gradient)
    counted = check_field(evolve(field, source=source), cylinder)
    nusselt = finding(check, "Nusselt number")["nusselt"]
    assert finding(counted, "Nusselt number")["nusselt"] == pytest.approx(0.95 * nusselt)
    heat = finding(counted, "heat from the wall")
    assert heat["value"] == f"{0.95 * by_gradient:.4g} W"
    by = f"counted by the solver ({by_gradient:.4g} W by the gradient at the wall)"
    assert by in heat["remark"]
    assert heat["heat_by_gradient_w"] == by_gradient


def test_a_cylinder_that_lies_upside_down_is_found_out(simulated: Checked, cylinder: Part) -> None:
    """Its mean Nusselt number is right, and its plume sinks: bottom and top change places."""
    field, check = simulated
    down = field.grid.copy()
    down.points = np.asarray(down.points) * (1.0, -1.0, -1.0)
    turned = finding(check_field(evolve(field, grid=down), cylinder), "Nusselt number")
    right = finding(check, "Nusselt number")
    assert turned["nusselt"] == pytest.approx(right["nusselt"], rel=0.01)
    assert turned["ratios"][2] == pytest.approx(1.0 / right["ratios"][2], rel=0.05)
    assert turned["verdict"] == "bad"


def test_a_draught_is_not_judged_by_still_air(simulated: Checked, cylinder: Part) -> None:
    """Its leeward side is like the top of still air: here the one turned by 90 degrees.

    Without the draught that the file states such a field is bad.
    """
    field, _ = simulated
    leeward = field.grid.copy()
    x, y, z = np.asarray(leeward.points).T
    leeward.points = np.column_stack((x, -z, y))
    source = field.source
    blown = evolve(source, facts=evolve(source.facts, draught_m_s=(0.0, -0.2, 0.0)))
    still, member = (
        finding(check_field(evolve(field, grid=leeward, source=one), cylinder), "Nusselt number")
        for one in (source, blown)
    )
    assert still["verdict"] == "bad"
    assert member["verdict"] == "-"
    assert "draught of 0.2 m/s that the field states" in member["remark"]
    assert member["draught_m_s"] == pytest.approx(0.2)
    assert member["nusselt"] == still["nusselt"]


def test_open_ends_are_found_and_seen_from_above(simulated: Checked, cylinder: Part) -> None:
    """The plume leaves at the top, in front of a camera that looks down."""
    field, check = simulated
    edge = finding(check, "edge of the data")
    assert edge["verdict"] == "doubtful"
    assert edge["hottest_k"]["+z"] > ROOM + 50.0
    excess = edge["hottest_k"]["+z"] - ROOM
    assert f"excess over the ambient 20 degC: +z up to {excess:.0f} K" in edge["remark"]
    assert all(edge["hottest_k"][side] < ROOM + 9.0 for side in ("-x", "+x", "-y", "+y", "-z"))
    assert finding(check, "camera's view")["share"] > 0.5
    assert finding(check, "camera's view")["verdict"] == "bad"
    assert share_through_open_sides(field, cylinder, np.array((0.0, 400.0, -50.0))) == 0.0


def test_the_edge_is_open_where_the_outermost_shell_is(tmp_path: Path) -> None:
    """Rays count as ``open_boundary`` where they enter behind the first of the usual shells."""
    air, block = hot_block.save(tmp_path)
    field = read_field(air)
    check = check_field(field, read_part(block))
    outermost = contour_shells(field).temperature_k[0]
    assert finding(check, "edge of the data")["limit_k"] == pytest.approx(outermost, abs=1e-6)


def test_spoilt_fields_are_found_out(simulated: Checked, cylinder: Part) -> None:
    """Another wall temperature in another room, and a gradient that lies."""
    field, _ = simulated
    cool = Air().refractivity(ROOM + 0.5 * (field.temperature_k - ROOM))
    spoilt = evolve(field, refractivity=cool, air=Air(temperature_k=313.15))
    check = check_field(spoilt, cylinder, wall_temperature_k=WALL)
    assert finding(check, "wall temperature")["verdict"] == "bad"
    assert finding(check, "coolest air")["verdict"] == "bad"
    assert check.verdict == "bad"
    cold = cylinder.transformed(np.diag((0.986, 0.986, 0.986, 1.0)))
    (gap,) = (
        one for one in check_field(field, cold).findings if one.name == "field's wall to part"
    )
    assert gap.verdict == "bad"
    assert "thermal expansion" in gap.remark
    object.__setattr__(spoilt, "gradient", 1.3 * spoilt.gradient)
    errors = gradient_errors(spoilt, wall_state(spoilt, cylinder))
    assert np.median(errors) == pytest.approx(0.3, abs=0.03)


def test_only_horizontal_cylinders_are_compared_with_the_rule(cylinder: Part) -> None:
    assert horizontal_cylinder_diameter(cylinder) == pytest.approx(27.0, abs=0.05)
    assert horizontal_cylinder_diameter(gear()) is None
    upright = cylinder.transformed([[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]])
    assert horizontal_cylinder_diameter(upright) is None


def test_a_field_without_a_wall_is_refused(cylinder: Part) -> None:
    axis = np.linspace(-100.0, 100.0, 21)
    grid = pv.StructuredGrid(*np.meshgrid(axis, axis, axis, indexing="ij"))
    grid = grid.cast_to_unstructured_grid()
    values = Air().refractivity(np.full(grid.n_points, 400.0))
    source = FieldSource("solid.vtu", "0" * 64, "T", "temperature", "mm")
    with pytest.raises(InputError) as error:
        check_field(IndexField(grid, values, Air(), source), cylinder)
    assert error.value.code == "field.no_wall"


def test_a_cold_wall_is_refused(tmp_path: Path) -> None:
    field, part = hot_block.save(tmp_path)
    cold = read_field(field)
    still = evolve(cold, refractivity=np.full(len(cold.refractivity), cold.ambient_refractivity))
    with pytest.raises(InputError) as error:
        check_field(still, read_part(part))
    assert (error.value.code, error.value.argument) == ("field.no_hot_air", "ambient")


def test_command_prints_verdicts_and_writes_numbers(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a hot block whose wall is 20 K hotter than it should be."""
    field, part = hot_block.save(tmp_path)
    words = ["field", "check", str(field), str(part), "-o", str(tmp_path / "check.json")]
    assert main([*words, "--wall-temperature=1273.15 K"]) == 0
    assert "Nusselt number" in capsys.readouterr().out
    content = json.loads((tmp_path / "check.json").read_text())
    assert (content["schema"], content["verdict"]) == ("iriftrace.field-check/1", "bad")
    found = {f["name"]: f for f in content["findings"]}
    assert found["wall temperature"]["verdict"] == "bad"
    assert found["wall temperature"]["numbers"]["worst_k"] == pytest.approx(20.0, abs=0.01)
    assert found["Nusselt number"]["verdict"] == "-"


def test_half_a_field_is_found_out(tmp_path: Path) -> None:
    """Solved on one side of a plane through the block: half of the sides and one are missing."""
    field, part = hot_block.save(tmp_path)
    hot_block.half(hot_block.air()).save(tmp_path / "half.vtu")
    check = check_field(read_field(tmp_path / "half.vtu"), read_part(part))
    covered = finding(check, "part in the field")
    assert covered["verdict"] == "bad"
    assert covered["covered"] == pytest.approx(0.5, abs=0.1)
    missing = covered["missing_of_region"]
    assert missing["plane -x"] == pytest.approx(1.0)
    assert missing["plane +y"] == pytest.approx(0.5, abs=0.05)
    assert "plane +x" not in missing
    assert "missing at plane -x (x -6 mm) 100%, plane " in covered["remark"]
    whole = check_field(read_field(field), read_part(part))
    assert finding(whole, "part in the field")["covered"] == 1.0
    heat = finding(whole, "heat from the wall")
    assert " mm) " in heat["remark"], "of planes with their place"
    assert "plane -x" in heat["regions_w_m2"]


def test_walls_of_bodies_are_not_the_parts(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A cooler support covers one of six sides of the block; the field names it."""
    air = hot_block.air()
    x, y, z = np.asarray(air.cell_centers().points).T
    beside = (x > 0.0) & (x < 10.0) & (np.maximum(np.abs(y), np.abs(z)) < hot_block.HALF)
    grid = air.extract_cells(np.flatnonzero(~beside))
    x, y, z = np.asarray(grid.points).T
    at_support = (x > 5.9) & (x < 10.1) & (np.maximum(np.abs(y), np.abs(z)) < 6.1)
    grid.point_data["T"][at_support] = 900.0
    grid.point_data["U"] = np.zeros((grid.n_points, 3))
    state_origin(grid, "OpenFOAM, steady", FieldFacts(bodies=("support",)))
    grid.save(tmp_path / "air.vtu")
    field, part = read_field(tmp_path / "air.vtu"), tmp_path / "block.stl"
    hot_block.block().export(part)
    mesh = trimesh.creation.box(extents=(4.0, 12.0, 12.0))
    support = evolve(part_from(mesh.apply_translation((8.0, 0.0, 0.0))), path="support.stl")
    write_bodies([Body(support)], tmp_path)
    words = ["field", "check", str(tmp_path / "air.vtu"), str(part), "-o"]
    words.append(str(tmp_path / "check.json"))
    moves = (f"--{what}-transform=translate 0 0 9" for what in ("field", "part"))
    assert main([*words, *moves, "--wall-temperature=1293.15 K"]) == 0
    findings = json.loads((tmp_path / "check.json").read_text())["findings"]
    found = {one["name"]: one["numbers"] for one in findings}
    assert found["wall temperature"]["share_within"] == 1.0
    assert found["field's wall to part"]["p95_mm"] < 1e-6
    covered = found["part in the field"]
    assert (covered["covered"], covered["missing_of_region"]) == (1.0, {})
    assert covered["touching"] == {"support": pytest.approx(1 / 6, rel=0.1)}
    wall = wall_state(field, read_part(part), [support])
    assert wall.area_mm2 == pytest.approx(5 * 144.0)
    assert wall.bodies_w != 0.0
    balance = found["heat balance"]
    assert balance["off"] == pytest.approx(
        balance["leaving_w"] / (wall.heat_w + wall.bodies_w) - 1.0
    )
    moved = read_part(part, ReadPart(transform=np.eye(4) + 100.0 * np.eye(4, k=3)))
    with pytest.raises(InputError, match="does not reach the part"):
        check_field(field, moved, bodies=[support])
    (tmp_path / "bodies" / "support.stl").unlink()
    capsys.readouterr()
    assert main(words) == 0
    assert "solved around bodies that are missing" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--diameter=-3", "-3 mm is that of no cylinder; give a positive one (--diameter)"),
        ("--origin=1,2", "3 numbers"),
        ("-o check.txt", "must end in .json"),
        ("--isosurfaces", "Iso-surfaces have no air"),
        ("--field-transform=translate 900 0 0", "does not reach the part"),
    ],
)
def test_wrong_options_end_with_one_sentence(
    words: str, message: str, fails: Callable[..., str]
) -> None:
    part = str(folder_of("cylinder") / "part.ply")
    given = [words] if "=" in words else words.split()
    assert message in fails("field", "check", str(CYLINDER_A), part, *given)

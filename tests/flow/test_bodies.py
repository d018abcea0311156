"""Bodies and a floor in the air around the part: walls of the case, copies, what is refused."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
import trimesh
from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.flow.simulate import result
from iriftrace.flow.simulate.bodies import Body, write_bodies
from iriftrace.flow.simulate.case import RECORD, Case, natural_case, symmetric_case
from iriftrace.flow.simulate.case_files import write_case
from iriftrace.flow.simulate.draught import Draught, draught_from
from iriftrace.flow.simulate.options import SimulationOptions
from iriftrace.flow.simulate.simulate import prepare
from iriftrace.io.bodies import bodies_beside
from iriftrace.io.field import read_field
from iriftrace.medium.source import FieldFacts
from iriftrace.part.part import Part
from validation.inputs import hot_block
from validation.inputs.parts import part_from


def block(name: str, extents: tuple[float, ...], centre: tuple[float, ...]) -> Part:
    mesh = trimesh.creation.box(extents)
    mesh.apply_translation(centre)
    return evolve(part_from(mesh), path=f"somewhere/{name}.stl")


# The cylinder's axis lies along x through (5, -3, 2) mm, and its radius is 13.5 mm.
TABLE = block("table", (300.0, 200.0, 10.0), (5.0, -3.0, -16.5))
SUPPORT = block("support", (20.0, 40.0, 30.0), (-40.0, -3.0, -20.0))


def with_bodies(part: Part, *bodies: Body, draught: Draught | None = None, **options: Any) -> Case:
    asked = SimulationOptions(wall_temperature="1100 degC", resolution="coarse", **options)
    return natural_case(part, asked, draught=draught, bodies=bodies)


def test_bodies_and_floor_are_walls(cylinder: Part, tmp_path: Path) -> None:
    """One has a temperature, the other takes up no heat, the floor is as cool as the air."""
    bodies = Body(TABLE, 353.15), Body(SUPPORT)
    write_case(with_bodies(cylinder, *bodies, floor=-40.0), tmp_path)
    kelvin = (tmp_path / "0/T").read_text()
    assert re.search(r"body1 { type fixedValue; value uniform 353\.15; }", kelvin)
    assert re.search(r"body2 { type zeroGradient; }", kelvin)
    assert re.search(r"bottom { type fixedValue; value uniform 293\.15; }", kelvin)
    assert '"(xmin|xmax|ymin|ymax|top)"' in kelvin
    for name in ("body1", "body2", "bottom"):
        assert f"{name} {{ type noSlip; }}" in (tmp_path / "0/U").read_text()
        assert f"{name} {{ type fixedFluxPressure;" in (tmp_path / "0/p_rgh").read_text()
    blocks = (tmp_path / "system/blockMeshDict").read_text()
    assert "bottom { type wall;" in blocks
    surface: Any = pv.read(tmp_path / "constant/triSurface/body1.stl")
    assert np.array(surface.bounds[4:]) * 1e3 == pytest.approx((-21.5, -11.5))
    mesher = (tmp_path / "system/snappyHexMeshDict").read_text()
    assert mesher.count("body2") == 4, "file and name in the geometry, edges, refinement"


def test_air_ends_at_the_floor(cylinder: Part) -> None:
    domain = with_bodies(cylinder, floor=-16.0).domain
    assert domain.lower[2] == -16.0
    assert domain.kept_lower[2] >= -16.0
    height = (domain.upper[2] + 16.0) / domain.cells[2]
    assert height == pytest.approx(22.0, rel=0.1)
    assert (domain.kept_upper[2] + 16.0) / height == pytest.approx(
        round((domain.kept_upper[2] + 16.0) / height)
    )


def test_touching_the_floor_is_allowed(cylinder: Part) -> None:
    bottom = float(cylinder.bounds[0, 2])
    with_bodies(cylinder, floor=bottom)
    for floor in (bottom + 1.0, 16.0, -500.0):
        with pytest.raises(InputError, match=f"floor at z = {floor:g} mm"):
            with_bodies(cylinder, floor=floor)


def test_record_names_what_lies_beside_the_field(cylinder: Part, tmp_path: Path) -> None:
    case = with_bodies(cylinder, Body(TABLE, 353.15), floor=-60.0)
    prepare(case, tmp_path / "case")
    record = json.loads((tmp_path / "case" / RECORD).read_text())
    assert record["floor_mm"] == -60.0
    (stored,) = record["bodies"]
    assert stored["temperature_k"] == 353.15
    write_bodies(case.bodies, tmp_path)
    copy: Any = pv.read(tmp_path / stored["file"])
    assert np.array(copy.bounds).reshape(3, 2).T == pytest.approx(TABLE.bounds, abs=1e-3)
    with pytest.raises(InputError, match="differs in bodies"):
        prepare(with_bodies(cylinder, Body(TABLE), floor=-60.0), tmp_path / "case")


def test_a_floor_blocks_the_view_as_bodies_do(cylinder: Part, tmp_path: Path) -> None:
    """As large as the field, a little below the floor's height; no body may have its name."""
    air = hot_block.air()
    case = with_bodies(cylinder, Body(TABLE), floor=-40.0)
    result._write(case, air, tmp_path / "field.vtu", "mean", FieldFacts())
    field = read_field(tmp_path / "field.vtu")
    assert field.source.facts.bodies == ("table", "floor")
    table, floor = bodies_beside(field)
    assert table.bounds == pytest.approx(TABLE.bounds, abs=1e-3)
    x, y, z = floor.bounds.T
    assert (*x, *y) == pytest.approx(air.bounds[:4])
    assert -40.1 < z[1] < -40.0
    assert field.source.facts.draught_m_s is None
    blown = evolve(case, draught=draught_from(0.2, (90.0,)))
    result._write(blown, air, tmp_path / "blown.vtu", "mean", FieldFacts())
    wind = read_field(tmp_path / "blown.vtu").source.facts.draught_m_s
    assert wind == pytest.approx((0.0, -0.2, 0.0), abs=1e-12)
    named = Body(block("floor", (9.0, 9.0, 9.0), (5.0, -3.0, -30.0)))
    with_bodies(cylinder, named)
    with pytest.raises(InputError, match='two bodies of the name "floor"'):
        with_bodies(cylinder, named, floor=-60.0)


def test_bodies_take_part_in_the_symmetry(cylinder: Part) -> None:
    """The support stands at one end of the cylinder."""
    assert symmetric_case(with_bodies(cylinder, Body(TABLE))) == "xy"
    assert symmetric_case(with_bodies(cylinder, Body(TABLE), Body(SUPPORT))) == "y"
    with_bodies(cylinder, Body(SUPPORT), symmetry="y")
    with pytest.raises(InputError, match=r"support.stl is not symmetric.*leave x out"):
        with_bodies(cylinder, Body(SUPPORT), symmetry="xy")


def test_body_that_fills_the_inlet_is_refused(cylinder: Part) -> None:
    """From one side only: it does no harm where the air leaves."""
    screen = Body(block("screen", (400.0, 30.0, 500.0), (0.0, 150.0, 0.0)))
    with pytest.raises(InputError, match=r"fill .*% of the side ymax"):
        with_bodies(cylinder, screen, draught=draught_from(0.1, (90.0,)))
    with_bodies(cylinder, screen, draught=draught_from(0.1, (270.0,)))
    table = Body(block("table", (600.0, 600.0, 10.0), (5.0, -3.0, -16.5)))
    with_bodies(cylinder, table, draught=draught_from(0.1, (90.0,)))
    wall = Body(block("wall", (900.0, 4.0, 1200.0), (0.0, 70.0, 0.0)))
    with pytest.raises(InputError, match="close the air between its side ymax"):
        with_bodies(cylinder, wall, draught=draught_from(0.1, (90.0,)))
    with_bodies(cylinder, wall, draught=draught_from(0.1, (270.0,)))


def test_bodies_that_cannot_be_are_refused(cylinder: Part) -> None:
    around = block("oven", (200.0, 60.0, 60.0), (5.0, -3.0, 2.0))
    for bodies, message in (
        ([Body(TABLE), Body(TABLE)], 'two bodies of the name "table"'),
        ([Body(evolve(TABLE, closed=False))], "is not closed"),
        ([Body(TABLE, 4000.0)], "cannot have 4000 K"),
        ([Body(block("far", (5.0, 5.0, 5.0), (900.0, 0.0, 0.0)))], "lies outside the air"),
        ([Body(around)], "the part lies inside the body"),
        ([Body(evolve(cylinder, path="part.stl"))], "the part lies inside the body"),
        ([Body(block("hall", (500.0, 500.0, 100.0), (0, 0, 300.0)))], "fills the upper corner"),
    ):
        with pytest.raises(InputError, match=message):
            with_bodies(cylinder, *bodies)

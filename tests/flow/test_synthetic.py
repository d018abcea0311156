"""Synthetic hot air: its formulas, its mesh, and that every result says what it is."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv
import trimesh
from attrs import evolve
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.cli import main
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.plain import structured
from iriftrace.flow.synthetic import mesh
from iriftrace.flow.synthetic.field import synthetic_field
from iriftrace.flow.synthetic.mesh import AirMesh, air_mesh, usual_mesh
from iriftrace.flow.synthetic.model import SyntheticAir, laminar_boundary_layer_mm, synthetic_air
from iriftrace.io.exr import read_exr
from iriftrace.io.field import read_field
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.origin import origin_of
from iriftrace.medium.source import FieldKind, FieldSource
from iriftrace.part.part import Part, part_of_mesh
from validation.inputs.parts import gear

WALL, ROOM = 1373.15, 293.15


def cylinder(radius: float = 6.0, length: float = 30.0) -> Part:
    mesh = trimesh.creation.cylinder(radius, length, sections=48)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, (0, 1, 0)))
    return part_of_mesh(mesh.vertices, mesh.faces, name="cylinder")


PARTS = {"cylinder": cylinder(), "gear": gear()}


@pytest.fixture(scope="module", params=PARTS)
def air(request: pytest.FixtureRequest) -> SyntheticAir:
    return synthetic_air(PARTS[request.param], boundary_layer_mm=4.0)


@pytest.fixture(scope="module")
def field(air: SyntheticAir) -> IndexField:
    return synthetic_field(air, evolve(usual_mesh(air), cell_mm=1.0, height_mm=20.0))


def test_gradient_is_that_of_the_temperature(air: SyntheticAir) -> None:
    check_gradient(air)


def check_gradient(air: SyntheticAir) -> None:
    """Central differences over 1e-4 mm are right to about 1e-8 of the largest gradient here.

    Where two points of the part are equally near, the gradient jumps; no random point is so near
    to such a place.
    """
    low, high = air.part.bounds
    points = np.random.default_rng(1).uniform(low - 8.0, np.add(high, (8.0, 8.0, 30.0)), (2000, 3))
    points = points[~air.surface.inside(points)]
    _, gradient = air.at(points)
    step = 1e-4
    differences = np.stack(
        [
            (air.at(points + step * e)[0] - air.at(points - step * e)[0]) / 2 / step
            for e in np.eye(3)
        ],
        axis=1,
    )
    assert np.linalg.norm(gradient, axis=1).max() > 100.0
    assert_allclose(differences, gradient, atol=1e-6 * np.abs(gradient).max())


def test_regions_have_their_own_temperature() -> None:
    """A head of 800 K on a cylinder of 1373 K: walls, gradient, field and origin follow it."""
    part = PARTS["cylinder"]
    air = synthetic_air(part, boundary_layer_mm=4.0, regions={"head +x": 800.0}, transition_mm=3.0)
    check_gradient(air)
    x = np.linspace(-15.0, 15.0, 31)
    below = np.column_stack((x, 0.0 * x, np.full(len(x), -6.0)))
    # Of the two groups of faces one is at the point and the other 15 - x away.
    share = 0.5 * (1.0 + np.tanh((x - 15.0) * 2 * np.arctanh(0.8) / 3.0))
    assert_allclose(air.at(below)[0], WALL + (800.0 - WALL) * share, atol=1e-6)
    ends = air.at(np.array(((15.0, 0.0, 0.0), (-15.0, 0.0, 0.0))))[0]
    assert_allclose(ends, (800.0, WALL), atol=1.0)
    assert "head +x 800 K" in air.origin
    field = synthetic_field(air, evolve(usual_mesh(air), cell_mm=1.0, height_mm=20.0))
    wall = field.wall_temperature_k(np.array(((15.0, 0.0, 0.0), (-15.0, 0.0, 0.0))))
    assert_allclose(wall, (800.0, WALL), atol=2.0)


def test_wall_has_its_temperature_whatever_the_plume(air: SyntheticAir) -> None:
    points = air.part.face_centres
    temperature, gradient = air.at(points)
    assert_allclose(temperature, WALL, rtol=1e-12)
    # It falls from the wall outwards, at the rate of the profile where there is no plume.
    below = air.part.face_normals[:, 2] < -0.9
    slope = np.einsum("ij,ij->i", gradient, air.part.face_normals)
    assert_allclose(slope[below], -2.0 * (WALL - ROOM) / 4.0, rtol=1e-9)
    assert (slope < 0).all()


def test_room_begins_where_the_boundary_layer_ends(air: SyntheticAir) -> None:
    low, high = air.part.bounds
    middle = air.part.centre
    for axis, sign in ((0, 1), (0, -1), (1, 1), (2, -1)):
        point = middle.copy()
        point[axis] = (high if sign > 0 else low)[axis] + sign * 4.0001
        assert air.at(point)[0] == pytest.approx(ROOM, abs=0.5)
    plume, beside = air.at(middle + np.array(((0.0, 0.0, 300.0), (200.0, 0.0, 300.0))))[0]
    assert plume > ROOM + 10.0
    assert beside == pytest.approx(ROOM)


def test_temperature_falls_with_the_distance() -> None:
    air = synthetic_air(PARTS["cylinder"], boundary_layer_mm=4.0)
    distance = np.linspace(0.0, 6.0, 200)
    down = air.at(np.outer(6.0 * np.cos(np.pi / 48) + distance, (0, 0, -1)))[0]
    up = air.at(np.outer(6.0 + distance, (0, 0, 1)))[0]
    assert (np.diff(down[distance < 4.0]) < 0).all()
    assert (np.diff(up) < 0).all()
    assert ((up >= ROOM) & (up <= WALL + 1e-9)).all()
    assert (up[1:] > down[1:]).all()


def test_still_air_is_a_boundary_layer_only() -> None:
    air = synthetic_air(PARTS["cylinder"], boundary_layer_mm=4.0, plume=0.0)
    assert air.plume is None
    assert "no plume" in air.origin
    assert air.at((0, 0, 8.0))[0] == pytest.approx(ROOM + (WALL - ROOM) * 0.25, rel=1e-9)


def test_plume_keeps_its_exponents() -> None:
    """Far above a long part the axis cools with z^-3/5 and the width grows with z^2/5."""
    plume = synthetic_air(cylinder(length=4000.0), boundary_layer_mm=4.0).plume
    assert plume is not None
    heights = np.array((60.0, 120.0))
    axis, _ = plume.excess(np.column_stack((0 * heights, 0 * heights, heights)))
    assert axis[1] / axis[0] == pytest.approx(2**-0.6, rel=1e-9)
    widths = plume.half_width(heights)
    assert widths[1] / widths[0] == pytest.approx(2**0.4, rel=0.01)
    beside, _ = plume.excess(np.column_stack((0 * heights, widths, heights)))
    assert_allclose(beside / axis, np.exp(-1), rtol=1e-9)


@pytest.mark.parametrize(
    ("part", "moments"),
    [
        (trimesh.creation.cylinder(60.0, 18.0, sections=256), (900.0, 900.0)),
        (trimesh.creation.annulus(25.0, 60.0, 18.0, sections=256), (1056.25, 1056.25)),
        (trimesh.creation.box((60.0, 60.0, 8.0)), (300.0, 300.0)),
        (trimesh.creation.box((60.0, 40.0, 8.0)), (300.0, 400.0 / 3.0)),
        (trimesh.creation.box((20.0, 300.0, 4.0)), (7500.0, 100.0 / 3.0)),
    ],
    ids=["disc", "annulus", "square", "oblong", "bar"],
)
def test_plume_follows_the_outline(part: trimesh.Trimesh, moments: tuple[float, float]) -> None:
    """Second moments of circle, ring and rectangle; the cross-section is integrated at the top."""
    part.apply_transform(trimesh.transformations.rotation_matrix(0.3, (0, 0, 1)))
    layer = 7.0
    body = part_of_mesh(part.vertices, part.faces, name="part")
    plume = synthetic_air(body, boundary_layer_mm=layer).plume
    assert plume is not None
    places = np.arange(-250.0, 250.0, 0.5)
    x, y = (rows.ravel() for rows in np.meshgrid(places, places))
    share, _ = plume.excess(np.column_stack((x, y, np.full_like(x, body.bounds[1, 2]))))
    assert share.max() == pytest.approx(plume.strength, rel=1e-6)
    section = 0.5**2 * share.sum() / plume.strength
    expected = np.sqrt(np.pi * 3.0 * sum(moments)) * layer
    assert section == pytest.approx(expected, rel=2e-4)
    shares = share / share.sum()
    spread = np.linalg.eigvalsh(np.einsum("n,ni,nj->ij", shares, *(2 * [np.stack((x, y), 1)])))
    # A uniform length 2a and a bell: a^2 / 3 along.
    assert spread[1] - spread[0] == pytest.approx(moments[0] - moments[1], rel=1e-3, abs=0.02)


def test_mesh_holds_the_plume() -> None:
    """Warm air at the sides of the usual mesh is below e^-9 of the axis's; little air is idle."""
    mesh = trimesh.creation.box((90.0, 40.0, 8.0))
    mesh.apply_transform(trimesh.transformations.rotation_matrix(0.6, (0, 0, 1)))
    air = synthetic_air(part_of_mesh(mesh.vertices, mesh.faces, name="oblique plate"))
    assert air.plume is not None
    size = usual_mesh(air)
    (left, near, _), (right, far, top) = air.part.bounds
    places = np.linspace(-200.0, 200.0, 401)
    x, y = (rows.ravel() for rows in np.meshgrid(places, places))
    share, _ = air.plume.excess(np.column_stack((x, y, np.full_like(x, top + size.height_mm))))
    beyond = (np.maximum(left - x, x - right) > size.sides_mm) | (
        np.maximum(near - y, y - far) > size.sides_mm
    )
    assert share[beyond].max() < np.exp(-9.0) * share.max()
    assert share[~beyond].max() == share.max()
    disc = trimesh.creation.cylinder(60.0, 18.0, sections=64)
    round_air = synthetic_air(part_of_mesh(disc.vertices, disc.faces, name="disc"))
    assert usual_mesh(round_air).sides_mm < 60.0


def test_plume_of_a_long_cylinder_is_a_sheet_half_as_wide_as_the_layer() -> None:
    plume = synthetic_air(cylinder(13.5, 170.0), boundary_layer_mm=7.5).plume
    assert plume is not None
    assert abs(plume.along[0]) == pytest.approx(1.0)
    assert plume.half_length_mm == pytest.approx(85.0, rel=0.015)
    assert plume.width_mm == pytest.approx(3.75, rel=0.03)


def test_boundary_layer_follows_laminar_similarity() -> None:
    """delta ~ D^(1/4) at the same temperatures, and 7.7 mm at the cylinder it is scaled from."""
    small, large = cylinder(13.5, 1e4), cylinder(27.0, 2e4)
    layers = [laminar_boundary_layer_mm(part, WALL, ROOM) for part in (small, large)]
    assert layers[0] == pytest.approx(7.7, rel=0.01)
    assert layers[1] / layers[0] == pytest.approx(2**0.25, rel=1e-6)


# The mesh --------------------------------------------------------------------------------------


def test_mesh_ends_on_the_part(air: SyntheticAir, field: IndexField) -> None:
    """The wall is closed, lies on the part and encloses its volume but for cut-off edges."""
    wall = field.wall
    assert wall.is_manifold
    assert_allclose(air.surface.distance(wall.points), 0.0, atol=2e-6)
    assert_array_equal(wall.point_data["refractivity"], field.hottest_refractivity)
    part = trimesh.Trimesh(air.part.vertices, air.part.faces)
    assert wall.volume == pytest.approx(part.volume, rel=0.04)


def test_cells_fill_the_box_around_the_part(air: SyntheticAir, field: IndexField) -> None:
    """No cell is turned inside out or left out, and neighbours share whole faces."""
    volumes = np.asarray(field.grid.compute_cell_sizes()["Volume"])
    assert (volumes >= 0).all()
    box = np.prod(np.ptp(field.grid.points, axis=0))
    assert volumes.sum() + field.wall.volume == pytest.approx(box, rel=1e-6)
    outer = field.grid.extract_surface(algorithm="geometry").split_bodies()
    assert outer.n_blocks == 2  # the box and the part: no crack between cells


def test_field_at_the_points_is_the_model(air: SyntheticAir, field: IndexField) -> None:
    points = np.asarray(field.grid.points, dtype=float)
    assert_allclose(field.temperature_k, air.at(points)[0], rtol=1e-5)
    assert field.temperature_k.max() == pytest.approx(WALL, abs=1e-9)
    # The gradient recovered from cells of about 1 mm in a layer of 4 mm: within a few per cent.
    gradient = air.at(points)[1]
    found = (
        field.gradient * (-(field.temperature_k**2) / ROOM / field.ambient_refractivity)[:, None]
    )
    near = (air.surface.distance(points) > 0.5) & (points[:, 2] < 0)
    size = np.linalg.norm(gradient[near], axis=1)
    error = np.linalg.norm(found[near] - gradient[near], axis=1)
    assert np.median(error[size > 50] / size[size > 50]) < 0.15


def test_the_value_says_that_it_is_synthetic(field: IndexField) -> None:
    """Without a file, too: what is measured in it has no uncertainty of the air."""
    assert field.source.facts.kind is FieldKind.SYNTHETIC


def test_finer_cells_come_closer_to_the_part() -> None:
    """Edges are cut off by a share of the cell, so the enclosed volume converges."""
    air = synthetic_air(PARTS["gear"], boundary_layer_mm=3.0, plume=0.0)
    volume = trimesh.Trimesh(air.part.vertices, air.part.faces).volume
    errors = []
    for cell in (1.6, 0.8):
        grid, _ = air_mesh(air, AirMesh(cell_mm=cell, sides_mm=3.0, height_mm=3.0))
        box = np.prod(np.ptp(grid.points, axis=0))
        errors.append(abs(box - grid.volume - volume) / volume)
    assert errors[1] < 0.5 * errors[0]


# What is refused -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"wall_k": 280.0}, "hotter than the room"),
        ({"wall_k": float("nan")}, "hotter than the room"),
        ({"boundary_layer_mm": 0.0}, "boundary layer of 0 mm"),
        ({"plume": 1.2}, "strength is 1.2"),
        ({"regions": {"rim": 900.0}}, 'no region "rim"'),
        ({"regions": {"*": 200.0}}, "must be hotter than the air"),
        ({"transition_mm": 3.0}, "two temperatures to lie between"),
    ],
)
def test_impossible_air_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        synthetic_air(PARTS["gear"], **options)


def test_a_part_in_another_unit_is_refused() -> None:
    """Air of the wrong size around a part of the wrong size would show nothing of it."""
    part = PARTS["cylinder"]
    metres = part_of_mesh(part.vertices / 1000.0, part.faces, name="metres.stl")
    with pytest.raises(InputError, match=r"metres\.stl is 0\.03") as refused:
        synthetic_air(metres)
    assert (refused.value.code, refused.value.argument) == ("part.unlikely_size", "length_unit")


def test_open_parts_and_endless_meshes_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    part = PARTS["gear"]
    with pytest.warns(IriftraceWarning, match="not closed"):
        opened = part_of_mesh(part.vertices, part.faces[1:], name="opened")
    with pytest.raises(InputError, match="opened is not closed"):
        synthetic_air(opened)
    air = synthetic_air(part)
    # The first one grows to that number, the others begin beyond it.
    monkeypatch.setattr(mesh, "MOST_CELLS", 100_000)
    for size in (AirMesh(0.2, 5.0, 5.0), AirMesh(1e-6, 5.0, 5.0), AirMesh(1.0, 1e12, 1e12)):
        with pytest.raises(InputError, match="more than 100,000 tetrahedra"):
            air_mesh(air, size)
    monkeypatch.undo()
    with pytest.raises(InputError, match="Cells of 50 mm at the wall would miss"):
        air_mesh(air, AirMesh(cell_mm=50.0, sides_mm=5.0, height_mm=5.0))
    sheet = trimesh.creation.box((10.0, 10.0, 1e-3))
    thin = synthetic_air(part_of_mesh(sheet.vertices, sheet.faces, name="sheet"), plume=0.0)
    with pytest.raises(InputError, match=r"do not resolve sheet, which is 0\.001 mm thin"):
        air_mesh(thin, AirMesh(cell_mm=0.7, sides_mm=2.0, height_mm=2.3))
    with pytest.raises(InputError, match="cell size is -1 mm"):
        AirMesh(cell_mm=-1.0, sides_mm=5.0, height_mm=5.0)


# The command, and what results say -------------------------------------------------------------


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with part, field, scene and rendering of a synthetic field."""
    folder = tmp_path_factory.mktemp("synthetic")
    trimesh.creation.box(extents=(12, 12, 12)).export(folder / "part.stl")
    commands = (
        "field synthetic part.stl -o field.vtu --boundary-layer 4mm --cell-size=1mm --height=15mm "
        "--gradient",
        "scene field.vtu part.stl -o scene/scene.xml --layers=3 --resolution=60,50 --scale=1 "
        "--sensor=6,5 --focal-length=20 --focus=50:250 --origin=60,-45,70",
        "render scene/scene.xml -o out.exr --no-figures",
    )
    for command in commands:
        words = [
            str(folder / word) if (folder / word).suffix and "=" not in word else word
            for word in command.split()
        ]
        assert main(words) == 0
    return folder


def test_file_says_that_it_is_synthetic(written: Path) -> None:
    grid = pv.read(written / "field.vtu")
    assert origin_of(grid).startswith("synthetic: ")
    assert set(grid.point_data.keys()) == {"T", "grad_T"}
    assert read_field(written / "field.vtu").source.origin == origin_of(grid)


@pytest.mark.usefixtures("variant")
def test_every_result_says_that_it_is_synthetic(written: Path) -> None:
    """Shells' table, field for the continuous engine, XML, EXR header, metrics."""
    from iriftrace.io.field_npz import load_field_file

    table = json.loads((written / "scene" / "shells" / "shells.json").read_text())
    assert table["source"]["origin"].startswith("synthetic: ")
    source = load_field_file(written / "scene" / "field.npz").source
    assert source == structured(table["source"], FieldSource)
    assert "<!-- Field: synthetic: " in (written / "scene" / "scene.xml").read_text()
    header = read_exr(written / "out.exr").header
    assert header["field"] == table["source"]
    metrics = json.loads((written / "out.json").read_text())
    for assumptions in (header["assumptions"], metrics["assumptions"]):
        assert assumptions["field_origin"] == table["source"]["origin"]
        assert assumptions["field_time"] == "steady"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("-o field.vtk", "must end in .vtu"),
        ("-o field.vtu --wall-temperature=10degC", "hotter than the room"),
        ("-o field.vtu --boundary-layer=4K", "'4K' cannot be converted to mm"),
        ("-o field.vtu --plume=2", "strength is 2"),
        ("-o none/field.vtu", "folder none does not exist"),
    ],
)
def test_wrong_options_end_with_one_sentence(
    words: str, message: str, fails: Callable[..., str]
) -> None:
    trimesh.creation.box(extents=(12, 12, 12)).export("part.stl")
    assert message in fails("field", "synthetic", "part.stl", *words.split())

"""Fit of part and field: gaps that are known, and mistakes of unit and axes named."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import trimesh
from attrs import evolve

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.mesh.transform import parse_transform
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.part_fit import Fit, fit_part_to_field, in_air
from iriftrace.medium.path_data import cells_of
from iriftrace.medium.source import FieldSource
from iriftrace.medium.volume import linear_volume
from iriftrace.part.part import Part
from iriftrace.scenes import folder_of
from validation.inputs import hot_block
from validation.oracles.aov_by_hand import make_part

HALF = np.array([5.0, 10.0, 20.0])
WALL_K = 1000.0


def box_part(centre: tuple[float, float, float] = (0.0, 0.0, 0.0), half: object = HALF) -> Part:
    mesh = trimesh.creation.box(extents=2 * np.asarray(half))
    return make_part(mesh.vertices + centre, mesh.faces)


@pytest.fixture(scope="module")
def hot_box() -> IndexField:
    """Air around a box of 10 x 20 x 40 mm: a grid of 2.5 mm cells from which the box is cut out.

    The temperature falls linearly with the distance from the box, so it is 1000 K at its wall.
    """
    grid = pv.ImageData(dimensions=(25, 29, 37), spacing=(2.5,) * 3, origin=(-30, -35, -45))
    centres = grid.cell_centers().points
    outside = np.any(np.abs(centres) > HALF, axis=1)
    cut = linear_volume(grid.extract_cells(np.flatnonzero(outside)))
    distance = np.maximum(np.abs(cut.points) - HALF, 0).max(axis=1)
    air = Air()
    temperature = np.maximum(WALL_K - 30.0 * distance, air.temperature_k)
    source = FieldSource("box.vtu", "0" * 64, "T", "temperature", "mm")
    return IndexField(cut, air.refractivity(temperature), air, source)


def test_matching_part_has_no_gap_and_no_warning(hot_box: IndexField) -> None:
    fit = fit_part_to_field(hot_box, box_part(), wall_temperature_k=WALL_K)
    assert fit.gap_median_mm == pytest.approx(0, abs=1e-4)
    assert fit.gap_p95_mm == pytest.approx(0, abs=1e-4)
    assert fit.wall_temperature_k == pytest.approx(WALL_K, abs=1e-3)
    assert fit.warnings == ()


def test_a_board_is_told_from_a_part_in_the_air(hot_box: IndexField) -> None:
    """A plate of the same data behind the box, with and without the field's inner wall."""
    board = box_part((0.0, 30.0, 0.0), (30.0, 2.0, 40.0))
    cells = cells_of(hot_box)
    for air in (cells, evolve(cells, wall=np.zeros_like(cells.wall))):
        assert in_air(air, box_part())
        assert not in_air(air, board)


def test_uniformly_smaller_part_has_this_gap(hot_box: IndexField) -> None:
    """0.5 mm less on every side: on the faces the gap is 0.5 mm, at the edges sqrt(2) as much."""
    assert fit_part_to_field(hot_box, box_part(half=HALF - 0.1)).warnings == ()
    fit = fit_part_to_field(hot_box, box_part(half=HALF - 0.5))
    assert fit.gap_median_mm == pytest.approx(0.5, abs=1e-4)
    assert fit.gap_p95_mm == pytest.approx(0.5 * np.sqrt(2), abs=1e-4)
    assert len(fit.warnings) == 1
    assert "thermal expansion" in fit.warnings[0]


@pytest.mark.parametrize(
    ("scale", "argument", "unit"),
    [
        (1e-3, "length_unit", "m"),
        (1e3, "field_length_unit", "m"),
        (1 / 25.4, "length_unit", "inch"),
        (0.1, "length_unit", "cm"),
    ],
)
def test_wrong_unit_is_named(hot_box: IndexField, scale: float, argument: str, unit: str) -> None:
    """The part's wall is then nowhere near the field's, so nothing could be computed."""
    with pytest.raises(InputError, match=rf"length_unit` {unit}\b") as refused:
        fit_part_to_field(hot_box, box_part(half=HALF * scale))
    assert (refused.value.code, refused.value.argument) == ("field.not_at_part", argument)


def test_a_unit_that_was_given_by_mistake_is_taken_back(hot_box: IndexField) -> None:
    """The field was read in metres, so that everything but one corner is far from the part."""
    source = evolve(hot_box.source, length_unit="m")
    part = box_part(centre=tuple(HALF - 1e-3 * HALF), half=1e-3 * HALF)
    with pytest.raises(InputError, match=r"times as large .* `field_length_unit` mm") as refused:
        fit_part_to_field(evolve(hot_box, source=source), part)
    assert refused.value.argument == "field_length_unit"


@pytest.mark.parametrize(
    ("factor", "unit"), [(1e3, "m"), (10.0, "cm"), (25.4, "inch"), (1e-3, "mm")]
)
@pytest.mark.parametrize("centre", [(0.0, 0.0, 0.0), (3.0, -5.0, 20.0)])
def test_a_field_in_another_unit_than_its_file_states_is_scaled(
    hot_box: IndexField, centre: tuple[float, float, float], factor: float, unit: str
) -> None:
    """A mesh built in mm that OpenFOAM takes for m: no other unit can be given, none is named."""
    part = box_part(centre=centre)
    source = evolve(hot_box.source, length_unit=unit, unit_stated=True)

    def scaled(scale: float) -> IndexField:
        grid = hot_box.grid.copy()
        grid.points = np.asarray(grid.points, dtype=np.float64) * scale
        return evolve(hot_box, grid=grid, source=source)

    with pytest.raises(InputError, match="`field_transform`") as caught:
        fit_part_to_field(scaled(factor), part)
    assert caught.value.argument == "field_transform"
    assert "length_unit" not in str(caught.value)
    scale = str(caught.value).split('`field_transform` "scale ')[1].split('"')[0]
    shift = str(caught.value).partition('`part_transform` "')[2].split('"')[0]
    mended = part.transformed(parse_transform(shift)) if shift else part
    assert fit_part_to_field(scaled(factor * float(scale)), mended).gap_p95_mm < 0.01


def test_a_part_in_metres_beside_a_field_that_states_metres(hot_box: IndexField) -> None:
    source = evolve(hot_box.source, length_unit="m", unit_stated=True)
    with pytest.raises(InputError, match=r"with `length_unit` m[. ]") as refused:
        fit_part_to_field(evolve(hot_box, source=source), box_part(half=HALF * 1e-3))
    assert refused.value.argument == "length_unit"


@pytest.mark.parametrize(
    ("centre", "axes"),
    [((0, 0, 0), [0, 2, 1]), ((0, 2, 4), [2, 0, 1]), ((0, 0, -8), [0, 1, 2])],
    ids=["y-up", "cyclic axes and an offset", "offset"],
)
def test_axes_and_offsets_are_named_and_the_advice_works(
    hot_box: IndexField, centre: tuple[float, float, float], axes: list[int]
) -> None:
    moved = box_part(centre, HALF[axes])
    fit = fit_part_to_field(hot_box, moved)
    (message,) = fit.warnings
    transform = message.split('`part_transform` "')[1].split('"')[0]
    mended = fit_part_to_field(hot_box, moved.transformed(parse_transform(transform)))
    assert mended.warnings == ()
    assert mended.gap_p95_mm < 1e-4 < fit.gap_p95_mm
    if axes == [0, 1, 2]:
        assert transform.replace("-0 ", "0 ") == "translate 0 0 8"


def test_part_elsewhere_is_refused(hot_box: IndexField) -> None:
    with pytest.raises(InputError, match=r"box\.vtu does not reach the part.*translate -500"):
        fit_part_to_field(hot_box, box_part(centre=(500, 0, 0)))


def test_other_shape_gets_both_sizes(hot_box: IndexField) -> None:
    (message,) = fit_part_to_field(hot_box, box_part(half=(4.0, 4.0, 20.0))).warnings
    assert "8 x 8 x 40 mm" in message
    assert "10 x 20 x 40 mm" in message


@pytest.mark.parametrize(
    ("expected", "words"), [(WALL_K - 6, "check the field's array"), (WALL_K - 273.15, "degC")]
)
def test_wall_temperature_is_compared(hot_box: IndexField, expected: float, words: str) -> None:
    (message,) = fit_part_to_field(hot_box, box_part(), wall_temperature_k=expected).warnings
    assert "1000.0 K" in message
    assert words in message
    close = fit_part_to_field(hot_box, box_part(), wall_temperature_k=WALL_K - 4.0)
    assert close.warnings == ()


def test_field_without_cavity_is_usable_but_unchecked() -> None:
    """A solver that also solves the solid leaves no inner wall."""
    grid = pv.ImageData(dimensions=(25, 29, 37), spacing=(2.5,) * 3, origin=(-30, -35, -45))
    source = FieldSource("solid.vti", "0" * 64, "T", "temperature", "mm")
    values = np.full(grid.n_points, float(Air().refractivity(800.0)))
    field = IndexField(linear_volume(grid), values, Air(), source)
    fit: Fit = fit_part_to_field(field, box_part(), wall_temperature_k=800.0)
    assert np.isnan(fit.gap_median_mm)
    assert np.isnan(fit.gap_p95_mm)
    assert fit.wall_temperature_k == pytest.approx(800.0, abs=1e-3)
    (message,) = fit.warnings
    assert "no cavity" in message
    assert "outside" not in message
    with pytest.raises(InputError, match="one of them was read in the wrong unit"):
        fit_part_to_field(field, box_part(half=HALF * 1e-3))
    with pytest.raises(InputError, match="does not reach"):
        fit_part_to_field(field, box_part(centre=(500, 0, 0)))


def test_field_of_half_a_part_is_noticed() -> None:
    """A field solved on one side of a plane: the wall fits, but half of the part is bare."""
    field = read_field(folder_of("cylinder") / "field.vtu")
    part = read_part(folder_of("cylinder") / "part.ply")
    assert fit_part_to_field(field, part).warnings == ()
    half = field.grid.extract_cells(np.flatnonzero(field.grid.cell_centers().points[:, 0] > 0))
    points = half.point_data["vtkOriginalPointIds"]
    halved = IndexField(half, field.refractivity[points], field.air, field.source)
    (message,) = fit_part_to_field(halved, part).warnings
    assert "mirror a field" in message
    assert 0.4 < float(message.split("%")[0]) / 100 < 0.6


def test_field_of_a_sector_is_noticed() -> None:
    """A twelfth of the air around a bar encloses no cavity."""
    angle, radius = np.radians([0.0, 15.0, 30.0]), [5.0, 8.0, 12.0, 20.0, 40.0]
    angle, radius, z = np.meshgrid(angle, radius, [-30.0, 0.0, 30.0], indexing="ij")
    grid = linear_volume(pv.StructuredGrid(radius * np.cos(angle), radius * np.sin(angle), z))
    values = np.full(grid.n_points, float(Air().refractivity(WALL_K)))
    source = FieldSource("sector.vts", "0" * 64, "T", "temperature", "mm")
    bar = trimesh.creation.cylinder(radius=5.0, height=40.0)
    field = IndexField(grid, values, Air(), source)
    (message,) = fit_part_to_field(field, make_part(bar.vertices, bar.faces)).warnings
    assert "no cavity" in message
    assert "9" in message.split("% of the part's surface lies outside of the data")[0][-2:]


def test_a_lost_vertex_does_not_keep_the_search_busy(tmp_path: Path) -> None:
    """With one at a thousand times its place, writing a scene took 24 s in place of 3 s."""
    grid = hot_block.air(6)
    grid.save(tmp_path / "air.vtu")
    block = hot_block.block()
    block.vertices[0] *= 1e6
    block.export(tmp_path / "block.stl")
    with pytest.warns(IriftraceWarning):
        part = read_part(tmp_path / "block.stl")
    with pytest.raises(InputError, match="times as large as the field"):
        fit_part_to_field(read_field(tmp_path / "air.vtu"), part)


def test_bare_surface_counts_by_area_not_by_triangle(hot_box: IndexField) -> None:
    """A block 4 mm too long at both ends: its ends, and what its sides have beyond the wall."""
    long_box = box_part(half=(5.0, 10.0, 24.0))
    ends, sides = 2 * 10.0 * 20.0, 60.0 * 2 * (24.0 - 20.2)
    bare = fit_part_to_field(hot_box, long_box).bare_share
    assert bare == pytest.approx((ends + sides) / long_box.area, abs=0.005)
    fewer = fit_part_to_field(hot_box, long_box, samples=500).bare_share
    assert fewer == pytest.approx(bare, abs=0.02)
    assert 500 * fewer == pytest.approx(round(500 * fewer))

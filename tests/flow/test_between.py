"""Air between states: a plume between two is where it is by its formula, and as strong."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.core.statistics import rms
from iriftrace.flow.between import field_between, write_field_between
from iriftrace.io.field import read_field
from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.source import FieldFacts, FieldSource, Variation
from validation.inputs.hot_block import AMBIENT
from validation.inputs.leaning_air import leaning


def column(x: float, y: float, cells: int = 30) -> IndexField:
    """A round column of hot air at a place, without a part, in cells of 2 mm."""
    axis = np.linspace(-30.0, 30.0, cells + 1)
    grid = pv.StructuredGrid(*np.meshgrid(axis, axis, axis, indexing="ij"))
    grid = grid.cast_to_unstructured_grid()
    places = np.asarray(grid.points, dtype=np.float64)
    off = (places[:, 0] - x) ** 2 + (places[:, 1] - y) ** 2
    air = Air(temperature_k=AMBIENT)
    index = air.ambient_refractivity * (1.0 - 0.5 * np.exp(-off / (2.0 * 5.0**2)))
    return IndexField(grid, index, air, FieldSource("column", "", "T", "temperature", "mm"))


@pytest.mark.parametrize("share", [0.5, 0.25])
def test_a_column_between_two_stands_between_them(share: float) -> None:
    """To the error of linear interpolation, h^2 / 8 of the second derivative, and half a move."""
    found = field_between([column(-4.0, 2.0), column(4.0, -6.0)], [1.0 - share, share])
    exact = column(-4.0 + 8.0 * share, 2.0 - 8.0 * share)
    lack = 0.5 * exact.ambient_refractivity
    assert np.abs(found.refractivity - exact.refractivity).max() < 2 * (2.0 / 5.0) ** 2 / 8 * lack


def test_a_leaning_plume_between_two(tmp_path: Path) -> None:
    """The mean of both fields has two weak plumes; the wall keeps its temperature."""
    one, other, exact = (leaning(lean, tmp_path, cells=24) for lean in (0.2, 0.6, 0.4))
    found = field_between([one, other])
    mean = 0.5 * (one.refractivity + other.refractivity)
    left, blended = (rms(values - exact.refractivity) for values in (found.refractivity, mean))
    assert left < 0.25 * blended
    wall = np.asarray(exact.wall.point_data["number"])
    assert found.refractivity[wall] == pytest.approx(exact.refractivity[wall], rel=1e-6)


def test_its_file_says_between_what_it_lies(tmp_path: Path) -> None:
    fields = [leaning(lean, tmp_path) for lean in (0.0, 0.4)]
    found = write_field_between(tmp_path / "between.vtu", fields, [3, 1])
    read = read_field(tmp_path / "between.vtu", air=fields[0].air)
    assert read.refractivity == pytest.approx(found.refractivity, rel=1e-6)
    assert "between 75% lean_0_0.vtu, 25% lean_0.4_0.vtu" in read.source.origin
    assert read.source.facts.draught_m_s is None


def test_its_draught_lies_between_theirs() -> None:
    """A quarter of 0.2 m/s and still air are 0.05 m/s."""
    still, blown = column(0.0, 0.0), column(4.0, 0.0)
    facts = FieldFacts(draught_m_s=(0.2, 0.0, 0.0))
    blown = evolve(blown, source=evolve(blown.source, facts=facts))
    found = field_between([still, blown], [3, 1])
    assert found.source.facts.draught_m_s == pytest.approx((0.05, 0.0, 0.0))


@pytest.mark.parametrize(
    ("count", "weights", "message"),
    [
        (1, None, "1 fields with 1 weights"),
        (2, [1.0], "2 fields with 1 weights"),
        (2, [-1.0, 2.0], "weights -1, 2 are not those"),
        (2, [0.0, 0.0], "weights 0, 0 are not those"),
    ],
)
def test_what_has_nothing_between_is_refused(
    count: int, weights: list[float] | None, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        field_between([column(0.0, 0.0, 4)] * count, weights)


def test_air_without_heat_has_no_place() -> None:
    cold = column(0.0, 0.0, 4)
    still = IndexField(cold.grid, np.full(125, cold.ambient_refractivity), cold.air, cold.source)
    with pytest.raises(InputError, match="no air that is hotter"):
        field_between([cold, still])


def test_nothing_lies_between_what_varies_a_field() -> None:
    one, other = column(0.0, 0.0), column(4.0, 0.0)
    facts = FieldFacts(variation=Variation("wall", 10.0, "0"))
    varied = evolve(other, source=evolve(other.source, facts=facts))
    with pytest.raises(InputError) as error:
        field_between([one, varied])
    assert error.value.code == "field.varies_another"
    assert "varies wall by 10 K" in str(error.value)

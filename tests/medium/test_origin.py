"""Statements of a field about itself: kind, time and symmetry, as results state them."""

from pathlib import Path

import pytest
import pyvista as pv
from attrs import evolve

import iriftrace
from iriftrace.medium.origin import facts_of, state_origin
from iriftrace.medium.source import FieldFacts, FieldKind, FieldSource
from validation.inputs import hot_block


@pytest.mark.parametrize(
    "origin",
    ["", "COMSOL 6.2", "synthetic, by hand", "a solver, steady state", "a solver, unsteady"],
)
def test_words_in_free_text_are_no_facts(tmp_path: Path, origin: str) -> None:
    """Whoever typed them: uncertainties and marks follow from `field_facts` alone."""
    grid = hot_block.air()
    grid.field_data["field_origin"] = [origin]
    grid.save(tmp_path / "air.vtu")
    source = iriftrace.read_field(tmp_path / "air.vtu").source
    assert source.origin == origin
    assert source.facts == FieldFacts()
    assert source.time == ""
    plain = FieldSource("air.vtu", "0", "T", "temperature", "mm", origin)
    assert plain.facts == FieldFacts()


def test_facts_come_back_from_a_file(tmp_path: Path) -> None:
    """Also where the words would say something else; damaged ones are none."""
    mirrored, wind = "mirrored at y = 0 mm", (0.1, 0.0, 0.0)
    facts = FieldFacts(FieldKind.UNSTEADY, 0.12, 27.0, ("table",), "mean", mirrored, wind)
    grid = hot_block.air()
    state_origin(grid, "steady, they say", facts)
    grid.save(tmp_path / "air.vtu")
    source = iriftrace.read_field(tmp_path / "air.vtu").source
    assert source.facts == facts
    assert source.time == "mean"
    assert evolve(source, facts=FieldFacts(FieldKind.STEADY)).time == "steady"
    damaged = pv.read(tmp_path / "air.vtu")
    damaged.field_data["field_facts"] = ['{"kind": "liquid"}']
    assert facts_of(damaged) is None

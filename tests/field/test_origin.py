"""What a field says of itself: kind, time and symmetry, as results state them."""

from pathlib import Path

import pytest
import pyvista as pv
from attrs import evolve

import iriftrace
from iriftrace.field.origin import facts_of, state_origin
from iriftrace.field.source import FieldFacts, FieldKind, FieldSource
from validation.inputs import hot_block


@pytest.mark.parametrize(
    ("origin", "kind", "time"),
    [
        ("", FieldKind.NOT_STATED, ""),
        ("COMSOL 6.2", FieldKind.NOT_STATED, ""),
        ("synthetic: boundary layer and plume", FieldKind.SYNTHETIC, "steady"),
        ("a solver, steady state", FieldKind.STEADY, "steady"),
        ("a solver, NOT STEADY", FieldKind.UNSTEADY, ""),
        ("a solver, unsteady", FieldKind.UNSTEADY, ""),
    ],
)
def test_words_of_other_programs(origin: str, kind: FieldKind, time: str) -> None:
    source = FieldSource("air.vtu", "0", "T", "temperature", "mm", origin)
    assert source.facts == FieldFacts(kind)
    assert source.time == time


def test_facts_come_back_from_a_file(tmp_path: Path) -> None:
    """Also where the words would say something else; damaged ones are none."""
    facts = FieldFacts(FieldKind.UNSTEADY, 0.12, 27.0, ("table",), "mean", "mirrored at y = 0 mm")
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

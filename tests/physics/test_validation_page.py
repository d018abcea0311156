"""docs/validation.md says what the program computes, as far as that takes seconds."""

import re
from pathlib import Path

import numpy as np
import pytest

from iriftrace.flow.synthetic.field import synthetic_field
from iriftrace.flow.synthetic.model import synthetic_air
from iriftrace.medium.air.refractivity import Air
from validation.flow import hall
from validation.flow.__main__ import PAGE, page_text, sections

NUMBER = re.compile(r"[+-]?\d+\.\d+")


@pytest.mark.usefixtures("variant")
def test_the_page_has_the_figures_of_the_formulas() -> None:
    """Words equal; bending within a unit of the last of four digits, differences within 0.1 %."""
    section = sections()[0]
    page = PAGE.read_text(encoding="utf-8")
    computed = section.markdown(section.compute(PAGE.parent))
    stated = page[page.index(f"## {section.title}") :][: len(computed) + 20].split("\n\n## ")[0]
    assert NUMBER.sub("#", stated.strip()) == NUMBER.sub("#", computed)
    found, written = (np.array(NUMBER.findall(text), float) for text in (computed, stated))
    np.testing.assert_allclose(found, written, rtol=1e-3, atol=0.11)


@pytest.mark.slow
@pytest.mark.usefixtures("variant")
def test_meshes_in_a_hall_are_compared_with_the_finest(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The same air differs by nothing; denser air by its n - 1, which the errors are linear in."""
    model = synthetic_air(hall.ring(), wall_k=1323.15, boundary_layer_mm=20.0, plume=0.0)
    denser = Air(temperature_k=293.15, pressure_pa=1.1 * 101325.0)
    fields = {
        1.0: synthetic_field(model),
        2.0: synthetic_field(model),
        3.0: synthetic_field(model, light=denser),
    }
    monkeypatch.setattr(hall, "VIEWS", {"windward": (1.0, 0.0)})
    monkeypatch.setattr(hall, "LATER_MM", 3.0)
    monkeypatch.setattr(hall, "solved", lambda _, mm, *times: (fields[mm], 1000, 60.0))
    rows = hall.hall_table(tmp_path, tuple(fields)).rows
    assert [row.split("|")[2].strip() for row in rows[1:]] == ["+0.0 %", "+10.0 %", "+10.0 %"]
    assert "0.06 mm at the wall, 1,000 cells, 1 minutes" in rows[0]


def test_sections_that_are_not_computed_keep_their_text() -> None:
    page = page_text({section.name: f"## {section.title}\n\nold" for section in sections()}, "")
    changed = page_text({"plate_air": f"## {sections()[2].title}\n\nnew"}, page)
    assert changed == page.replace(f"{sections()[2].title}\n\nold", f"{sections()[2].title}\n\nnew")

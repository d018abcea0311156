"""docs/validation.md says what the program computes, as far as that takes seconds."""

import re

import numpy as np
import pytest

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


def test_sections_that_are_not_computed_keep_their_text() -> None:
    page = page_text({section.name: f"## {section.title}\n\nold" for section in sections()}, "")
    changed = page_text({"plate_air": f"## {sections()[2].title}\n\nnew"}, page)
    assert changed == page.replace(f"{sections()[2].title}\n\nold", f"{sections()[2].title}\n\nnew")

"""The accuracy page: its cheap sections hold, and the page in docs/ has them all.

Sections ``exact``, ``cells`` and ``noise`` are what `tests/physics` asserts line by line.
"""

import re
from pathlib import Path

import pytest

from validation.line import Line, Section, beyond
from validation.page import write_page
from validation.sections import SECTIONS
from validation.sections.trouble import lines_of, troubles

PAGE = Path(__file__).parents[2] / "docs" / "accuracy.md"


OTHER_RAYS, RARE_RAYS = 20, 2
"""By how many rays of a million other processors may differ; the second where no ray ended here."""

Row = tuple[str, str, str]


def rows_in_docs(section: Section) -> list[Row]:
    """What, expected and obtained of a section of the page in docs/."""
    _, _, text = PAGE.read_text(encoding="utf-8").partition(f"## {section.title}\n")
    table = text.partition("\n## ")[0].partition("|---|---|---|---|---|\n")[2]
    rows = [line.split(" | ") for line in table.strip().splitlines()]
    return [(row[0].removeprefix("| "), row[1], row[2]) for row in rows]


def assert_same_figures(found: str, kept: str, *, rays: bool) -> None:
    """The same words around numbers that agree within 5 %, or counts of rays within a few."""
    number = r"-?\d[\d,]*(?:\.\d+)?(?:e-?\d+)?"
    assert re.sub(number, "#", found) == re.sub(number, "#", kept)
    pairs = zip(re.findall(number, found), re.findall(number, kept), strict=True)
    for one, other in (tuple(text.replace(",", "") for text in pair) for pair in pairs):
        if rays:
            few = OTHER_RAYS if float(other) else RARE_RAYS
            assert abs(float(one) - float(other)) <= few, (found, kept)
        else:
            assert float(one) == pytest.approx(float(other), rel=0.05), (found, kept)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ledger", "air", "plume"])
@pytest.mark.usefixtures("variant")
def test_errors_are_within_their_bounds_and_figures_are_those_in_docs(
    name: str, tmp_path: Path
) -> None:
    (section,) = (section for section in SECTIONS if section.name == name)
    lines = section.compute(tmp_path)
    assert beyond(lines) == []
    kept = rows_in_docs(section)
    assert [line.case for line in lines] == [case for case, _, _ in kept]
    for line, (_, expected, obtained) in zip(lines, kept, strict=True):
        assert_same_figures(line.expected, expected, rays=name == "ledger")
        assert_same_figures(line.obtained, obtained, rays=name == "ledger")


@pytest.mark.slow
@pytest.mark.usefixtures("variant")
def test_a_correction_is_wrong_by_what_the_field_is(tmp_path: Path) -> None:
    """In its own air nothing is left; a contrast that is off by 5 % leaves 5 % of the error."""
    (section,) = (section for section in SECTIONS if section.name == "other-air")
    lines = section.compute(tmp_path)
    assert beyond(lines) == []
    kept = [case for case, _, _ in rows_in_docs(section)]
    assert [line.case for line in lines] == kept


@pytest.mark.slow
@pytest.mark.usefixtures("variant")
def test_no_ray_is_lost_where_shells_cut_the_part_or_end_open() -> None:
    """With 40 shells and gradient normals; status 5 counts the rays whose steps do not add up."""
    shells, status_5, opened = [], [], []
    for case in troubles():
        lines = {line.case: line for line in lines_of(case, (40,), ("gradient",))}
        assert beyond(list(lines.values())) == []
        ending = lines[f"{case.name}, 40 shells: rays without a status"]
        assert ending.error == 0
        shells += [lines[name].obtained for name in lines if "cut the part" in name]
        status_5.append("index_mismatch" in ending.obtained)
        opened.append("open_boundary" in ending.obtained)
    assert status_5[:2] == [False, True]
    assert opened == [False, False, True]
    assert [int(text) > 10 for text in shells] == [True]


@pytest.mark.slow
@pytest.mark.usefixtures("variant")
@pytest.mark.filterwarnings("ignore:Mitsuba's own integrators show no true displacement")
def test_a_renderers_own_loop_is_wrong_by_many_times_the_signal(tmp_path: Path) -> None:
    (section,) = (section for section in SECTIONS if section.name == "naive")
    *_, times = section.compute(tmp_path)
    assert float(times.obtained.split()[0]) > 5


def test_the_page_in_docs_has_every_section_and_no_error_beyond_its_bound() -> None:
    text = PAGE.read_text(encoding="utf-8")
    for section in SECTIONS:
        assert f"## {section.title}\n" in text
        assert section.text in text
    # A figure beyond its bound is set in bold.
    assert "| **" not in text


def test_a_page_shows_what_left_its_bound(tmp_path: Path) -> None:
    lines = [Line("a", "1", "2", 100.0, 1.0), Line("b", "", "3 µm"), Line("c", "0", "0", 0, 0)]
    section = Section("some", "Some title", "What it is.", lambda _: lines)
    assert write_page(tmp_path / "page.md", [section], "a_variant") == lines
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert "| a | 1 | 2 | **1e+02 %** | 1 % |" in text
    assert "| b |  | 3 µm |  |  |" in text
    assert beyond(lines) == [lines[0]]


def test_a_check_cannot_pass_for_want_of_a_bound() -> None:
    for figure in (Line("a", "", "3 µm"), Line("b", "0", "3 µm", 3.0), Line("c", "0", "", None, 1)):
        with pytest.raises(ValueError, match="there is no error or no bound"):
            assert figure.holds
    with pytest.raises(ValueError, match="none of the figures has a bound"):
        beyond([Line("a", "", "3 µm"), Line("b", "0", "3 µm", 3.0)])

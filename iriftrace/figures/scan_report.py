"""The report of a scan or correction: one sheet of paper, with the rest folded away."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from iriftrace.core.files import FileOrigin
from iriftrace.core.plain import JsonObject
from iriftrace.figures import describe, describe_scan
from iriftrace.figures.answer import group_table, influences
from iriftrace.figures.describe_scan import TRUE_CLOUDS, Row
from iriftrace.figures.report_page import Page, png_picture
from iriftrace.io.refusals import damaged


def write_scan_report(
    path: Path,
    values: JsonObject,
    origin: FileOrigin,
    png: bytes = b"",
    space: bytes = b"",
    turns: str = "",
) -> None:
    """Write the report of a scan or correction from the values of its JSON file and its pictures.

    Raises InputError if the values are not those of such a result, or the file cannot be written.
    """
    try:
        page = scan_page(values, png, space, turns)
    except (LookupError, TypeError, ValueError) as error:
        raise damaged(origin.path, repr(error), "compute the result again") from error
    page.write(path, origin)


def scan_page(values: JsonObject, png: bytes = b"", space: bytes = b"", turns: str = "") -> Page:
    """The page of the JSON values of a scan or correction.

    Its first sheet of paper has all that is not folded: what was measured, the verdicts, its
    picture `png`, the one in space, and U. On a screen the rest can be opened, and the HTML `turns`
    takes the place of the picture in space.
    """
    simulated = TRUE_CLOUDS[values["schema"]] == "cold"
    rows = describe_scan.describe(values)
    what = "What hot air adds to a measurement" if simulated else "Measurement through hot air"
    title = f"{what}: {describe.name_of(values['part'])}"
    page = Page(title, values.get("version", ""), sheet=True, turns=bool(turns))

    page.section("answer")
    source, *fitted = describe_scan.sentences(rows, "field")
    synthetic = source.startswith("SYNTHETIC")
    page.add("names", *describe.measured(values), *[("Air", source)] * (not synthetic))
    doubts = [text for group in _DOUBTS for text in describe_scan.sentences(rows, group)]
    page.add("doubt", *[_EXAMPLE, source] * synthetic, *fitted, *doubts)
    headings, sizes = describe_scan.table(rows, "size")
    page.add("verdicts", *sizes, headings=headings)
    stated = describe_scan.uncertain_values(values)
    said = ("answer",) if simulated else ("verdict", "result")
    page.add("answer", *(text for group in said for text in describe_scan.sentences(rows, group)))
    page.add("text", None if values["features"] else _no_feature(values))
    shown = "error along the normal" if simulated else "deviation from the part before and after"
    page.add(
        "pictures", png_picture("picture", f"The camera's picture, coloured by the {shown}.", png)
    )

    groups, *shares = group_table(stated)
    table = partial(page.add, "names", *shares, title="U by group", headings=groups)
    if len(stated) > _BESIDE:
        page.section("groups")
        table()
    page.section("uncertainty", look="beside")
    caption = "The points in space, coloured by what hot air added to them."
    page.add("pictures", png_picture("space", caption, space, turns))
    if len(stated) <= _BESIDE:
        table()
    page.add("text", _U_NOTE if stated else None, title="What U and the verdict mean")
    uncovered = dict.fromkeys(influences(u) for u, _ in stated.values())
    more = describe_scan.sentences(rows, "warning")
    page.add("list", *uncovered, *more, *describe.assumed(values), title="Not covered")

    page.section("values", "All values", "folded")
    page.add("list", *[] if simulated else describe_scan.sentences(rows, "answer"))
    _add_facts(page, rows, "feature", "Sizes")
    page.add("text", _FEATURE_NOTE if values["features"] else None)
    _add_facts(page, rows, "planes", "Distances and angles of planes")
    what = "Error" if simulated else "Correction"
    _add_facts(page, rows, "region", f"{what} along the part's outward normal")
    page.add("text", *describe_scan.sentences(rows, "note"))
    points = [(row.name, row.value) for row in rows if row.group == "points"]
    page.add("numbers", *points, title="Points", headings=("outcome", "points"))

    assumed = describe.assumption_rows(values["assumptions"])
    page.section("setting", "Provenance and settings", "folded")
    page.add("names", *describe.scan_setting(values))
    page.add("names", *assumed, title="Assumptions in force")
    return page


_DOUBTS = ("larger", "uncertainty")

_BESIDE = 2
"""Largest number of values whose U by group has room next to the picture in space."""

_EXAMPLE = "Example air: from formulas, not of your hall, so nothing is decided."

_FEATURE_NOTE = (
    "Diameters, of a cone at the stated point of its axis, and form deviations (peak to valley)."
)

_U_NOTE = (
    "The value lies within U of the stated one with a probability of 95 % (JCGM 101; k = U / u), "
    "for the size on the drawing where that is stated. A feature is accepted if the probability "
    "of a true value outside its tolerance is at most 5 %, rejected if it is at least 95 %, else "
    "it is not decided (JCGM 106, ISO 14253-1)."
)


def _no_feature(values: JsonObject) -> str:
    one_line = any(region["measured"] is None for region in values.get("regions", ()))
    return (
        "No region of the part has enough points that determine a plane, cylinder, cone or sphere"
        f"{'; those of one line of a laser lie in a plane' * one_line}."
    )


def _add_facts(page: Page, rows: Sequence[Row], group: str, title: str = "") -> None:
    """Add a table of the facts of a group."""
    headings, cells = describe_scan.table(rows, group)
    page.add("numbers", *cells, title=title, headings=headings)

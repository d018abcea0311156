"""The report of a result: one HTML page that works offline and without Python."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from matplotlib.figure import Figure

from iriftrace.camera.pose import pose_text
from iriftrace.core.files import FileOrigin, saved_at, write_whole
from iriftrace.core.plain import JsonObject
from iriftrace.core.units import counted
from iriftrace.figures import describe, describe_scan
from iriftrace.figures.answer import group_table, influences
from iriftrace.figures.describe_scan import TRUE_CLOUDS, Row
from iriftrace.figures.style import figure_bytes
from iriftrace.figures.sweep import sweep_charts, sweep_pictures
from iriftrace.image.resolution import FRONTAL
from iriftrace.io.refusals import damaged
from iriftrace.planning import texts
from iriftrace.planning.candidates import name_of as metric_name
from iriftrace.planning.cover import plan_views
from iriftrace.planning.criteria import SHOWN, Views
from iriftrace.planning.stability import stability
from iriftrace.sweep.store import attribute, origin_of

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.planning.summary import SweepSummary

# In the order of the page; a picture that is not listed comes last, under its file's name.
# {error} is the ranked one, of a rig the error along the normal.
_CAPTIONS = {
    "pareto": "Coverage against {error}, coloured by lateral resolution. Ringed poses are "
    "beaten by no other one in everything at once.",
    "map_score": "Combined score over the direction or distance from which the camera looks.",
    "map_displacement": "{title} over the direction or distance from which the camera looks.",
    "map_coverage": "Seen fraction of the area over the direction or distance of the camera.",
    "map_axial": "Resolution along the line of sight.",
    "map_lateral": "Resolution across the line of sight.",
    "map_scatter": "Scatter over the fields, over the direction or distance of the camera.",
    "scene_score": "The camera poses around the part, coloured by the combined score.",
    "scene_displacement": "The camera poses around the part, coloured by {error}.",
    "scene_coverage": "The camera poses around the part, coloured by coverage.",
    "scene_axial": "The camera poses around the part, coloured by axial resolution.",
    "scene_lateral": "The camera poses around the part, coloured by lateral resolution.",
    "scene_scatter": "The camera poses around the part, coloured by scatter over the fields.",
    "view_best": "What the best pose sees.",
    "view_smallest_displacement": "What the pose with the smallest {error} sees.",
    "view_largest_displacement": "What the pose with the largest {error} sees.",
    "faces_displacement": "How far hot air moves the points of each face, over all poses.",
    "faces_times_seen": "How many poses see each face.",
    "faces_incidence": "The best angle at which any pose sees each face.",
    "histograms": "How the metrics are distributed over the poses.",
    "histograms_normalised": "The same, normalised as they enter the score.",
    "rays": "Outcome of the rays of each pose, and how much they met.",
}

_SUMMARY_FIGURES = ("view_best", "scene_score")
_SUMMARY_ROWS = 5
"""Pictures and rows of the ranking on the first page."""

_MOST_REASONS = 200

BlockKind = Literal[
    "text", "answer", "doubt", "list", "lines", "numbers", "names", "verdicts", "pictures"
]


_TYPED = re.compile(r"(?<=\d )(um|degC)\b|(?<=\()um(?=\))")


def _typeset(unit: re.Match[str]) -> str:
    return "µm" if unit[0] == "um" else "°C"


class Page:
    """A page that is composed from top to bottom; what is empty is left out.

    Its question stands below the title; `version` is that of the package that wrote the result. A
    `sheet` is printed on one sheet of paper, where the picture at the end of its first section has
    the height that is left.
    """

    def __init__(
        self, title: str, version: object, question: str = "", *, sheet: bool = False
    ) -> None:
        self.title, self.version, self.question = title, str(version), question
        self.sheet = sheet
        self.sections: list[JsonObject] = []

    def section(
        self, name: str, title: str = "", look: Literal["", "beside", "folded"] = ""
    ) -> None:
        """Begin a section, whose blocks lie side by side, or which is folded and not printed."""
        self.sections.append({"name": name, "title": title, "look": look, "blocks": []})

    def add(
        self, kind: BlockKind, *content: object, title: str = "", headings: Iterable[str] = ()
    ) -> None:
        """Add a block to the last section: sentences, lines, rows (cells), or pictures.

        Sentences are text, an answer or a doubt in a box, or a list; rows have numbers, which may
        end with a verdict, or texts after a name; pictures are those of `_picture`. The title
        stands above the block, and headings above the columns of rows.
        """
        if found := tuple(filter(None, content)):
            block = {"kind": kind, "content": found, "title": title, "headings": tuple(headings)}
            self.sections[-1]["blocks"].append(block)

    def write(self, path: Path, origin: FileOrigin | None) -> None:
        """Write the page about a file's values, complete or not at all; its folder must exist."""
        from jinja2 import Environment, PackageLoader, StrictUndefined

        environment = Environment(
            loader=PackageLoader("iriftrace.figures"),
            autoescape=True,
            undefined=StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        # The terminal writes what each keyboard has.
        environment.filters["typeset"] = lambda text: _TYPED.sub(_typeset, str(text))
        template = environment.get_template("report.html.jinja")
        saved = "" if origin is None else saved_at(origin.path)
        write_whole(path, template.render(page=self, origin=origin, saved=saved))


def _picture(name: str, caption: str, png: bytes) -> tuple[str, str, str] | None:
    """Anchor, caption and content of a PNG as the page has them; None if there is none."""
    return (name, caption, base64.b64encode(png).decode("ascii")) if png else None


def write_report(
    path: Path,
    dataset: xr.Dataset,
    summary: SweepSummary,
    *,
    top: int = SHOWN,
    views: Views | None = None,
) -> tuple[str, ...]:
    """Write the report of a sweep as one HTML file.

    Parameters
    ----------
    path
        The HTML file; an existing one is replaced when the new one is complete.
    dataset, summary
        The sweep's dataset and summary.
    top
        Rows of the ranking.
    views
        Number of poses that together see the most, and limits within which they must see a face.

    Returns
    -------
    tuple of str
        Missing pictures and the reasons, a sentence each; the page states them, too.

    Raises
    ------
    InputError
        The file cannot be written, or no row is requested.
    """
    figures, missing = sweep_pictures(dataset, summary)
    figures = sweep_charts(summary) | figures
    page = sweep_page(dataset, summary, figures, missing, top=top, views=views)
    page.write(path, origin_of(dataset))
    return missing


def sweep_page(
    dataset: xr.Dataset,
    summary: SweepSummary,
    figures: Mapping[str, Figure],
    missing: Iterable[str] = (),
    *,
    top: int = SHOWN,
    views: Views | None = None,
) -> Page:
    """The page of a sweep with these figures; parameters as of `write_report`."""
    plan, error = summary.plan, texts.in_words(summary.displacement)
    ranking, front = texts.ranking_table(summary, top), texts.front_table(summary)
    best = pose_text(summary.matrices[plan.best], summary.distance[plan.best])
    words = {"error": error, "title": summary.displacement.title}
    pictures = {
        name: _picture(name, _CAPTIONS.get(name, name).format(**words), figure_bytes(figures[name]))
        for name in {**_CAPTIONS, **figures}
        if name in figures
    }
    device = "camera" if summary.devices is None else "sensor"
    part = describe.name_of(attribute(dataset, "part"))
    version = dataset.attrs.get("version", "")
    page = Page(f"Where to put the {device}: {part}", version, _question(summary, device, part))

    page.section("summary")
    page.add("answer", _best_text(summary), *_rests_on(dataset, summary))
    page.add("doubt", texts.alternative_text(summary))
    page.add("text", f"Pose {plan.best}: {best.look_at}.")
    page.add("numbers", *ranking.rows[:_SUMMARY_ROWS], headings=ranking.headings)
    page.add("pictures", *(pictures[name] for name in pictures if name in _SUMMARY_FIGURES))

    page.section("setting", "Setting")
    page.add("names", *describe.sweep_setting(dataset, summary))

    page.section("best", "Best pose")
    where = summary.matrices[plan.best], summary.distance[plan.best]
    for pose, title, in_file in describe.devices_at(summary, f"Pose {plan.best}", *where):
        page.add("lines", *pose.matrix, title=title)
        page.add("lines", *pose.xml, title=in_file)

    if views is not None:
        chosen = plan_views(dataset, views, plan.criteria)
        table = texts.views_table(summary, chosen)
        page.section("views", "Several views")
        page.add("text", f"{texts.views_title(summary, views)}.")
        page.add("numbers", *table.rows, headings=table.headings)
        page.add("text", texts.views_text(summary, chosen))

    page.section("ranking", "Ranking")
    page.add("numbers", *ranking.rows, headings=ranking.headings)
    page.add("text", ranking.note, texts.stability_text(summary))
    if len(plan.criteria.needed) > 1:
        _add_stability(page, summary)

    page.section("front", "Poses that none beats")
    text = (
        f"No other pose is at least as good as one of these in {error}, coverage, axial and "
        "lateral resolution and better in one of them (Pareto front): for any weights, the best "
        "pose is among them."
    )
    page.add("text", text)
    page.add("numbers", *front.rows, headings=front.headings)
    page.add("text", front.note)

    page.section("figures", "Figures")
    page.add("pictures", *(pictures[name] for name in pictures if name not in _SUMMARY_FIGURES))
    page.add("text", *missing)

    page.section("limits", "Limits")
    page.add("list", *describe.sweep_limits(dataset, summary))
    page.add("names", *describe.sweep_assumptions(dataset), title="Assumptions in force")
    headings = ("outcome", "rays", "fraction of all that did not miss")
    page.add("numbers", *describe.sweep_rays(dataset), title="Rays of all poses", headings=headings)
    unranked = [(str(pose), reason) for pose, reason in plan.unranked.items()][:_MOST_REASONS]
    page.add("names", *unranked, title="Poses without a rank", headings=("pose", "reason"))
    return page


def _question(summary: SweepSummary, device: str, part: str) -> str:
    region, weights = summary.plan.criteria.region, summary.plan.criteria.weights
    of_it = "" if region == "part" else f", and of it the region {region},"
    score = " + ".join(
        f"{weights[metric.key]:g} times "
        + ("(1 - coverage)" if metric.key == "coverage" else texts.in_words(metric))
        for metric in summary.metrics
        if weights[metric.key]
    )
    return (
        f"From where should the {device} look at {part}{of_it} to measure it best through the hot "
        f"air around it? Every pose of a sweep was traced through the hot air; the score is {score}"
        ", each normalised to 0 to 1, the smaller the better."
    )


def _best_text(summary: SweepSummary) -> str:
    plan, best = summary.plan, summary.plan.best
    values = ", ".join(
        f"{texts.in_words(quantity)} "
        + (
            f"0 ({FRONTAL})"
            if quantity is summary.axial and summary.sees_frontally(best)
            else f"{quantity.values[best]:.4g} {quantity.unit}"
        )
        for quantity in summary.metrics
    )
    return (
        f"Pose {best}{summary.setting(best)} is the best of "
        f"{counted(len(plan.order), 'ranked pose')}, with the score {plan.score[best]:.3f}: "
        f"{values}."
    )


def _rests_on(dataset: xr.Dataset, summary: SweepSummary) -> tuple[str | None, ...]:
    """Facts that limit the reliability of the answer, a sentence each."""
    fields, assumed = describe.fields_of(dataset), attribute(dataset, "assumptions")
    origins = describe.distinct(one.get("origin") or "not stated" for one in fields)
    time = assumed.get("field_time", "not stated")
    return (
        f"{describe.origin_text(fields, '; '.join(origins))}. Time of the field: {time}.",
        assumed.get("field_fit"),
        describe.engines_text(dataset),
        summary.devices,
        texts.warned_text(summary),
        texts.least_error_text(summary),
        texts.other_statistics_text(summary),
    )


def _add_stability(page: Page, summary: SweepSummary) -> None:
    """Ranks of the best pose with other weights, one varied at a time."""
    varied = stability(summary.plan)
    rows = [
        (
            metric_name(name, summary.plan.criteria),
            *map(str, chain.from_iterable(zip(ranks, varied.winners[name], strict=True))),
        )
        for name, ranks in varied.ranks.items()
    ]
    best = summary.plan.best
    title = f"Rank of pose {best}, and the best pose then, when one weight varies by ±50 %"
    low, high = (f"rank at {sign}50 %" for sign in "\N{MINUS SIGN}+")
    headings = ("weight of", low, "best pose", high, "best pose")
    page.add("numbers", *rows, title=title, headings=headings)


def write_scan_report(
    path: Path, values: JsonObject, origin: FileOrigin, png: bytes = b"", space: bytes = b""
) -> None:
    """Write the report of a scan or correction from the values of its JSON file and its pictures.

    Raises InputError if the values are not those of such a result, or the file cannot be written.
    """
    try:
        page = scan_page(values, png, space)
    except (LookupError, TypeError, ValueError) as error:
        raise damaged(origin.path, repr(error), "compute the result again") from error
    page.write(path, origin)


def scan_page(values: JsonObject, png: bytes = b"", space: bytes = b"") -> Page:
    """The page of the JSON values of a scan or correction.

    Its first sheet of paper has all that is not folded: what was measured, the verdicts, its
    picture `png`, the one in space, and U. The rest can be opened on a screen.
    """
    simulated = TRUE_CLOUDS[values["schema"]] == "cold"
    rows = describe_scan.describe(values)
    what = "What hot air adds to a measurement" if simulated else "Measurement through hot air"
    title = f"{what}: {describe.name_of(values['part'])}"
    page = Page(title, values.get("version", ""), sheet=True)

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
        "pictures", _picture("picture", f"The camera's picture, coloured by the {shown}.", png)
    )

    headings, *cells = group_table(stated)
    table = partial(page.add, "names", *cells, title="U by group", headings=headings)
    if len(stated) > _BESIDE:
        page.section("groups")
        table()
    page.section("uncertainty", look="beside")
    caption = "The points in space, coloured by what hot air added to them."
    page.add("pictures", _picture("space", caption, space))
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

"""The report of a sweep: one HTML page that works offline and without Python."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from iriftrace.camera.pose import pose_text
from iriftrace.core.units import counted
from iriftrace.figures import describe
from iriftrace.figures.report_page import Page, png_picture
from iriftrace.figures.style import figure_bytes
from iriftrace.figures.sweep import sweep_charts, sweep_pictures
from iriftrace.image.resolution import FRONTAL
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
        name: png_picture(
            name, _CAPTIONS.get(name, name).format(**words), figure_bytes(figures[name])
        )
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
        "lateral resolution and better in one of them (Pareto front): for any positive "
        "weights, the best pose is among them."
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

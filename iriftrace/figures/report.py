"""The report of a sweep: one HTML page that works offline and without Python."""

from __future__ import annotations

import json
from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.camera.pose import pose_text
from iriftrace.core.plain import JsonObject
from iriftrace.core.units import counted
from iriftrace.field.source import stated_source, synthetic_mark
from iriftrace.figures import page
from iriftrace.figures.style import figure_bytes
from iriftrace.figures.sweep import sweep_charts, sweep_pictures
from iriftrace.image.aov_image import Status
from iriftrace.image.ray_statistics import percent
from iriftrace.image.resolution import FRONTAL
from iriftrace.planning import texts
from iriftrace.planning.candidates import name_of as metric_name
from iriftrace.planning.cover import NO_LIMITS, ViewLimits, plan_views
from iriftrace.planning.stability import stability
from iriftrace.sweep.store import attribute, scene_of, traced_through_cells

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


def report_content(
    dataset: xr.Dataset,
    summary: SweepSummary,
    top: int,
    views: int | None = None,
    limits: ViewLimits = NO_LIMITS,
) -> dict[str, object]:
    """Texts and tables of the page, with `top` rows of the ranking and a set of `views`."""
    plan = summary.plan
    chosen = None if views is None else plan_views(dataset, views, limits, plan.criteria)
    ranking = texts.ranking_table(summary, top)
    part = page.name_of(attribute(dataset, "part"))
    device = "camera" if summary.devices is None else "sensor"
    best, varied = plan.best, stability(plan)
    second = summary.second_at(summary.matrices[best])
    return dict(
        title=f"Where to put the {device}: {part}",
        question=_question(summary, device, part),
        answer=_answer(summary),
        rests_on=_rests_on(dataset, summary),
        unclear=texts.alternative_text(summary),
        setting=_setting_rows(dataset, summary),
        assumptions=_assumptions(dataset),
        ranking=ranking,
        error=texts.in_words(summary.displacement),
        front=texts.front_table(summary),
        best=pose_text(summary.matrices[best], summary.distance[best]),
        best_pose=best,
        second=None if second is None else pose_text(second, summary.distance[best]),
        device=summary.rig.get("device", ""),
        stability=texts.stability_text(summary),
        varied_weights=[
            (
                metric_name(name, plan.criteria),
                *map(str, chain.from_iterable(zip(ranks, varied.winners[name], strict=True))),
            )
            for name, ranks in varied.ranks.items()
        ],
        rays=_rays(dataset),
        limits=_limits(dataset, summary),
        unranked=tuple(
            (str(pose), reason) for pose, reason in list(plan.unranked.items())[:_MOST_REASONS]
        ),
        views=None if chosen is None else texts.views_table(summary, chosen),
        views_title=texts.views_title(summary, limits),
        views_text="" if chosen is None else texts.views_text(summary, chosen),
    )


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


def _answer(summary: SweepSummary) -> str:
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


def _assumptions(dataset: xr.Dataset) -> page.Rows:
    """Assumptions that hold for all poses, and engines of the poses."""
    rows = {key: page.value_text(value) for key, value in attribute(dataset, "assumptions").items()}
    if other := _engines_text(dataset):
        rows["engine"] = "; ".join(filter(None, (rows.get("engine"), other)))
    return tuple((key.replace("_", " "), text) for key, text in rows.items())


def _rays(dataset: xr.Dataset) -> page.Rows:
    whole = dataset.sel(region="part")
    counts = {
        status: int(np.maximum(whole[f"rays_{status.key}"].values, 0).sum()) for status in Status
    }
    met = max(1, sum(counts.values()) - counts[Status.MISSED])
    fractions = {status: percent(count, met) for status, count in counts.items()}
    fractions[Status.MISSED] = ""
    return tuple(
        (status.text.capitalize(), f"{count:,}", fractions[status])
        for status, count in counts.items()
        if count
    )


def _limits(dataset: xr.Dataset, summary: SweepSummary) -> tuple[str, ...]:
    plan = summary.plan
    whole = dataset.sel(region="part")
    good = np.asarray(whole["rays_good"].values)
    total = len(good)
    failed = sum(bool(str(text)) for text in dataset["failure"].values)
    empty = int(np.count_nonzero((good >= 0) & (good < plan.criteria.min_hits)))
    sentences = [
        f"{len(plan.unranked)} of {total} poses are not ranked; {failed} failed and {empty} see "
        f"fewer than {plan.criteria.min_hits} good rays of the part."
    ]
    passed = int(np.maximum(dataset["rays_open_boundary"].values, 0).sum())
    seen = max(1, int(np.maximum(good, 0).sum()))
    area = dataset["face_area"].values
    unseen = area[dataset["face_times_seen"].values == 0].sum() / area.sum()
    sentences += [
        f"{passed:,} good rays ({100 * passed / seen:.3g} %) pass an open end of the data, where "
        "the plume beyond is not modelled.",
        f"{100 * unseen:.1f} % of the part's area is seen by no pose.",
        *plan.warnings,
        "The ranking compares the poses of this sweep only; a pose between them may be better "
        "(iriftrace plan --refine).",
    ]
    return tuple(sentences)


def _engines_text(dataset: xr.Dataset) -> str:
    """Number of poses that were traced through the field, because shells are too few."""
    through = traced_through_cells(dataset)
    if through.all() or not through.any():
        return ""
    return (
        f"{through.sum()} of {len(through)} poses were traced through the field data, as the "
        "shells are too few."
    )


def _rests_on(dataset: xr.Dataset, summary: SweepSummary) -> tuple[str, ...]:
    """Facts that limit the reliability of the answer, a sentence each."""
    fields = _fields(dataset)
    origins = _distinct(one.get("origin") or "not stated" for one in fields)
    marks = (synthetic_mark(stated_source(one)) for one in fields)
    mark = next(filter(None, marks), None)
    assumed = attribute(dataset, "assumptions")
    time = assumed.get("field_time", "not stated")
    sentences = (
        f"{page.origin_text(mark, '; '.join(origins))}. Time of the field: {time}.",
        assumed.get("field_fit", ""),
        _engines_text(dataset),
        summary.devices,
        texts.warned_text(summary),
        texts.least_error_text(summary),
        texts.other_statistics_text(summary),
    )
    return tuple(filter(None, sentences))


def _setting_rows(dataset: xr.Dataset, summary: SweepSummary) -> page.Rows:
    scene, sha256 = scene_of(dataset)
    variables = attribute(dataset, "scene").get("variables") or {}
    focal = np.unique(dataset["focal_length"].values)
    criteria = summary.plan.criteria
    least = f" and a coverage of {criteria.min_coverage:g}" if criteria.min_coverage else ""
    return (
        ("Part", page.file_text(attribute(dataset, "part"))),
        ("Field", _field(dataset)),
        ("Scene", page.file_text({"path": scene, "sha256": sha256}) if scene else "not stated"),
        ("Scene parameters", ", ".join(f"{k} = {v}" for k, v in variables.items()) or "as written"),
        ("Camera", page.camera_text(attribute(dataset, "camera"), varied=len(focal) > 1)),
        ("Poses", _orbit(summary)),
        *((f"Varied: {one.name}", ", ".join(_distinct(one.values))) for one in summary.varied),
        ("Region ranked", "whole part" if criteria.region == "part" else criteria.region),
        (
            "Normalisation",
            f"minimum to {criteria.percentile:g}th percentile; beyond it: {criteria.outside}; at "
            f"least {criteria.min_hits} good rays{least}",
        ),
        (
            "Traced with",
            f"iriftrace {dataset.attrs.get('version', 'of unknown version')}, Mitsuba variant "
            f"{dataset.attrs.get('variant', 'not stated')}",
        ),
    )


def _fields(dataset: xr.Dataset) -> list[JsonObject]:
    """Fields of all scenes; that of the sweep's own attribute if they do not state it."""
    try:
        scenes = json.loads(dataset.attrs.get("scenes", "[]"))
    except ValueError:
        scenes = []
    several: list[JsonObject] = []
    for scene in scenes:
        if isinstance(scene, dict):
            members = [member.get("source") or {} for member in scene.get("members") or []]
            several += members or [scene.get("field") or {}]
    return several if len(several) > 1 else [attribute(dataset, "field")]


def _field(dataset: xr.Dataset) -> str:
    texts = [
        page.file_text(one) + (f", {one['quantity']}" if one.get("quantity") else "")
        for one in _fields(dataset)
    ]
    wavelength = dataset.attrs.get("wavelength_nm")
    light = f"; light of {float(wavelength):g} nm" if isinstance(wavelength, int | float) else ""
    return "; ".join(_distinct(texts)) + light


def _distinct(values: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(values))


def _orbit(summary: SweepSummary) -> str:
    azimuth = np.quantile(summary.azimuth_on_maps, (0.0, 1.0)) % 360.0
    ranges = [
        f"{name} {' to '.join(dict.fromkeys(f'{end:.4g}' for end in ends))}{unit}"
        for name, ends, unit in (
            ("azimuth", azimuth, "°"),
            ("elevation", np.quantile(summary.elevation, (0.0, 1.0)), "°"),
            ("distance to the target", np.quantile(summary.distance, (0.0, 1.0)), " mm"),
        )
    ]
    return f"{len(summary.distance)}, {', '.join(ranges)}; angles {summary.angles_of}"


def write_report(
    path: Path,
    sweep: Path,
    dataset: xr.Dataset,
    summary: SweepSummary,
    *,
    top: int = 10,
    views: int | None = None,
    limits: ViewLimits = NO_LIMITS,
) -> tuple[str, ...]:
    """Write the report of a sweep as one HTML file.

    Parameters
    ----------
    path
        The HTML file; an existing one is replaced when the new one is complete.
    sweep
        The sweep's file.
    dataset, summary
        The sweep's dataset and summary.
    top
        Rows of the ranking.
    views, limits
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
    content = report_content(dataset, summary, top, views, limits)
    pictures, missing = sweep_pictures(dataset, summary)
    figures = {**sweep_charts(summary), **pictures}
    names = [name for name in {**_CAPTIONS, **figures} if name in figures]
    page.write_page(
        path,
        "report.html.jinja",
        sweep,
        str(dataset.attrs.get("version", "")),
        content=content,
        figures=[
            {
                "name": name,
                "caption": _CAPTIONS.get(name, name).format(
                    error=content["error"], title=summary.displacement.title
                ),
                "png": page.in_page(figure_bytes(figures[name])),
            }
            for name in names
        ],
        missing=missing,
        summary_figures=_SUMMARY_FIGURES,
        summary_rows=_SUMMARY_ROWS,
    )
    return missing

"""Setting of a sweep for its report, and the facts that its answer depends on."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.core.plain import JsonObject
from iriftrace.field.source import stated_source, synthetic_mark
from iriftrace.figures.page import Rows, file_text
from iriftrace.planning.texts import least_error_text, other_statistics_text, warned_text
from iriftrace.sweep.store import attribute, scene_of, traced_through_cells

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.planning.summary import SweepSummary


def engines_text(dataset: xr.Dataset) -> str:
    """Number of poses that were traced through the field, because shells are too few."""
    through = traced_through_cells(dataset)
    if through.all() or not through.any():
        return ""
    return (
        f"{through.sum()} of {len(through)} poses were traced through the field data, as the "
        "shells are too few."
    )


def rests_on(dataset: xr.Dataset, summary: SweepSummary) -> tuple[str, ...]:
    """Facts that limit the reliability of the answer, a sentence each."""
    fields = _fields(dataset)
    origins = _distinct(one.get("origin") or "not stated" for one in fields)
    marks = (synthetic_mark(stated_source(one)) for one in fields)
    mark = next(filter(None, marks), "Field")
    assumed = attribute(dataset, "assumptions")
    time = assumed.get("field_time", "not stated")
    sentences = (
        f"{mark}: {'; '.join(origins)}. Time of the field: {time}.",
        assumed.get("field_fit", ""),
        engines_text(dataset),
        summary.devices,
        warned_text(summary),
        least_error_text(summary),
        other_statistics_text(summary),
    )
    return tuple(filter(None, sentences))


def setting_rows(dataset: xr.Dataset, summary: SweepSummary) -> Rows:
    scene, sha256 = scene_of(dataset)
    variables = attribute(dataset, "scene").get("variables") or {}
    focal = np.unique(dataset["focal_length"].values) if "focal_length" in dataset else [0.0]
    criteria = summary.plan.criteria
    least = f" and a coverage of {criteria.min_coverage:g}" if criteria.min_coverage else ""
    return (
        ("Part", file_text(attribute(dataset, "part"))),
        ("Field", _field(dataset)),
        ("Scene", file_text({"path": scene, "sha256": sha256}) if scene else "not stated"),
        ("Scene parameters", ", ".join(f"{k} = {v}" for k, v in variables.items()) or "as written"),
        ("Camera", _camera(attribute(dataset, "camera"), varied=len(focal) > 1)),
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
    several = [one for scene in scenes if isinstance(scene, dict) for one in _fields_of(scene)]
    return several if len(several) > 1 else [attribute(dataset, "field")]


def _field(dataset: xr.Dataset) -> str:
    texts = [
        file_text(one) + (f", {one['quantity']}" if one.get("quantity") else "")
        for one in _fields(dataset)
    ]
    wavelength = dataset.attrs.get("wavelength_nm")
    light = f"; light of {float(wavelength):g} nm" if isinstance(wavelength, int | float) else ""
    return "; ".join(_distinct(texts)) + light


def _fields_of(scene: JsonObject) -> list[JsonObject]:
    """Fields of one scene: those of an ensemble's members, or its only one."""
    members = [member.get("source") or {} for member in scene.get("members") or []]
    return members or [scene.get("field") or {}]


def _distinct(values: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(values))


def _camera(camera: JsonObject, *, varied: bool) -> str:
    if not camera:
        return "not stated"
    focal = camera.get("focal_length_mm")
    lens = "" if focal is None or varied else f"focal length {focal:g} mm, "
    near, far = camera["focus_mm"]
    depth = f"{near:g} mm to {'infinity' if far is None else f'{far:g} mm'}"
    distorted = ", lens distortion" if camera.get("distortion") else ""
    (width, height), (columns, rows) = camera["sensor_mm"], camera["resolution"]
    return (
        f"{camera['projection']}, {lens}sensor {width:g} \N{MULTIPLICATION SIGN} {height:g} mm, "
        f"{columns} \N{MULTIPLICATION SIGN} {rows} pixels, in focus from {depth}{distorted}"
    )


def _orbit(summary: SweepSummary) -> str:
    ranges = [
        f"{name} {values.min():.4g} to {values.max():.4g}{unit}"
        for name, values, unit in (
            ("azimuth", summary.azimuth, "°"),
            ("elevation", summary.elevation, "°"),
            ("distance to the target", summary.distance, " mm"),
        )
    ]
    return f"{len(summary.distance)}, {', '.join(ranges)}; angles {summary.angles_of}"

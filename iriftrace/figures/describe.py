"""Rows of tables and sentences of the report in which results state what they are."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.camera.pose import PoseText, pose_text
from iriftrace.core.plain import JsonObject
from iriftrace.image.aov_image import Status
from iriftrace.image.ray_statistics import percent
from iriftrace.medium.source import FieldSource, stated_source, synthetic_mark
from iriftrace.sweep.store import attribute, scene_of, traced_through_cells

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import ArrayLike

    from iriftrace.core.arrays import FloatArray
    from iriftrace.planning.summary import SweepSummary

Rows = tuple[tuple[str, ...], ...]
"""Cells of a table, row by row."""


def name_of(file: JsonObject) -> str:
    """Name of a part's or field's file from its provenance."""
    return file.get("source") or (Path(file["path"]).name if file.get("path") else "the part")


def file_text(named: JsonObject) -> str:
    """Name of a file and the beginning of its SHA-256, or that it is not stated."""
    if not named.get("path"):
        return "not stated"
    sha256 = str(named.get("sha256") or "")
    return name_of(named) + (f" (SHA-256 {sha256[:12]}\N{HORIZONTAL ELLIPSIS})" if sha256 else "")


def provenance_rows(stated: JsonObject, source: FieldSource | None) -> Rows:
    """Names and values of what a result states about itself, with whole checksums."""
    files = {name: stated.get(name) or {} for name in ("scene", "part")}
    if members := (stated.get("ensemble") or {}).get("members"):
        files |= {f"field {member['number']}": member["source"] for member in members}
    elif source is not None:
        files["field"] = {"path": source.path, "sha256": source.sha256}
    rows = {
        **{
            name: f"{Path(file['path']).name}, SHA-256 {file.get('sha256') or 'not stated'}"
            for name, file in files.items()
            if file.get("path")
        },
        "origin of the field": source.origin if source else "",
        "wavelength": f"{stated['wavelength_nm']:g} nm" if stated.get("wavelength_nm") else "",
        "engine": stated.get("engine", ""),
        "normals": stated.get("normals", ""),
        "written by": f"iriftrace {stated['version']}" if "version" in stated else "",
    }
    return tuple((name, str(text)) for name, text in rows.items() if text)


def camera_text(camera: JsonObject, *, varied: bool = False) -> str:
    """Lens, sensor and focus of a device, without a focal length that is `varied`."""
    if not camera:
        return "not stated"
    focal = camera.get("focal_length_mm")
    lens = "" if focal is None or varied else f"focal length {focal:g} mm, "
    near, far = camera["focus_mm"]
    depth = f"in focus from {near:g} mm to {'infinity' if far is None else f'{far:g} mm'}"
    if not near and far is None:
        depth = "in focus at any distance (no focus stated)"
    distorted = ", lens distortion" if camera.get("distortion") else ""
    (width, height), (columns, rows) = camera["sensor_mm"], camera["resolution"]
    return (
        f"{camera['projection']}, {lens}sensor {width:g} \N{MULTIPLICATION SIGN} {height:g} mm, "
        f"{columns} \N{MULTIPLICATION SIGN} {rows} pixels, {depth}{distorted}"
    )


def place_text(camera: JsonObject) -> str:
    """Position of a device."""
    return f"at ({', '.join(f'{row[3]:.1f}' for row in camera['matrix'][:3])}) mm"


def origin_text(fields: Iterable[JsonObject | None], origin: str) -> str:
    """Origin of one field or several, without full stop; the mark of synthetic ones comes first."""
    marks = (synthetic_mark(stated_source(one)) for one in fields)
    mark = next(filter(None, marks), None)
    return f"{mark}: {origin.replace('synthetic: ', '')}" if mark else f"Field: {origin}"


def assumption_rows(assumed: JsonObject) -> Rows:
    """Assumptions in force and their texts."""
    return tuple(
        (key.replace("_", " "), ", ".join(map(str, text)) if isinstance(text, list) else str(text))
        for key, text in assumed.items()
    )


def sweep_setting(dataset: xr.Dataset, summary: SweepSummary) -> Rows:
    """Part, field, scene and camera of a sweep, its poses, and how they are ranked."""
    scene, sha256 = scene_of(dataset)
    variables = attribute(dataset, "scene").get("variables") or {}
    focal = np.unique(dataset["focal_length"].values)
    fields = distinct(
        file_text(one) + (f", {one['quantity']}" if one.get("quantity") else "")
        for one in fields_of(dataset)
    )
    wavelength = dataset.attrs.get("wavelength_nm")
    light = f"; light of {float(wavelength):g} nm" if isinstance(wavelength, int | float) else ""
    criteria = summary.plan.criteria
    least = f" and a coverage of {criteria.min_coverage:g}" if criteria.min_coverage else ""
    return (
        ("Part", file_text(attribute(dataset, "part"))),
        ("Field", "; ".join(fields) + light),
        ("Scene", file_text({"path": scene, "sha256": sha256})),
        ("Scene parameters", ", ".join(f"{k} = {v}" for k, v in variables.items()) or "as written"),
        ("Camera", camera_text(attribute(dataset, "camera"), varied=len(focal) > 1)),
        ("Poses", _orbit(summary)),
        *((f"Varied: {one.name}", ", ".join(distinct(one.values))) for one in summary.varied),
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


def fields_of(dataset: xr.Dataset) -> list[JsonObject]:
    """Fields in the means of a sweep's scenes; that of its own attribute if they state none."""
    try:
        scenes = json.loads(dataset.attrs.get("scenes", "[]"))
    except ValueError:
        scenes = []
    several: list[JsonObject] = []
    for scene in scenes:
        if isinstance(scene, dict):
            listed = [one for one in scene.get("members") or [] if one.get("weight", 1.0) > 0.0]
            members = [member.get("source") or {} for member in listed]
            several += members or [scene.get("field") or {}]
    return several if len(several) > 1 else [attribute(dataset, "field")]


def devices_at(
    summary: SweepSummary, name: str, matrix: FloatArray, distance_mm: float
) -> Iterator[tuple[PoseText, str, str]]:
    """The camera's pose, and that of a rig's second device, which moves with it.

    With each come the titles of its matrix and of its lines for the scene file.
    """
    second = summary.second_at(matrix)
    yield placed(name, matrix, distance_mm, "the sensor" if second is None else "the first sensor")
    if second is not None:
        sensor = f'the second sensor (id="{summary.rig["device"]}")'
        yield placed("Second device with it", second, distance_mm, sensor)


def placed(
    name: str, matrix: ArrayLike, distance_mm: float, sensor: str
) -> tuple[PoseText, str, str]:
    """A pose, and the titles of its matrix and of its lines inside a sensor of the scene file."""
    return (
        pose_text(matrix, distance_mm),
        f"{name}, camera to world (x right, y down, z forward; mm)",
        f"In the scene file, inside {sensor}",
    )


def distinct(values: Iterable[str]) -> list[str]:
    """Each value once, in their order."""
    return list(dict.fromkeys(values))


def _orbit(summary: SweepSummary) -> str:
    azimuth = np.quantile(summary.azimuth_on_maps, (0.0, 1.0)) % 360.0
    ranges = [
        f"{name} {' to '.join(distinct(f'{end:.4g}' for end in ends))}{unit}"
        for name, ends, unit in (
            ("azimuth", azimuth, "°"),
            ("elevation", np.quantile(summary.elevation, (0.0, 1.0)), "°"),
            ("distance to the target", np.quantile(summary.distance, (0.0, 1.0)), " mm"),
        )
    ]
    return f"{len(summary.distance)}, {', '.join(ranges)}; angles {summary.angles_of}"


def engines_text(dataset: xr.Dataset) -> str:
    """Number of poses of a sweep traced through the field, because shells are too few; or ""."""
    through = traced_through_cells(dataset)
    if through.all() or not through.any():
        return ""
    return (
        f"{through.sum()} of {len(through)} poses were traced through the field data, as the "
        "shells are too few."
    )


def sweep_assumptions(dataset: xr.Dataset) -> Rows:
    """Assumptions that hold for all poses, and engines of the poses."""
    assumed = attribute(dataset, "assumptions")
    if engines := engines_text(dataset):
        assumed["engine"] = "; ".join(filter(None, (assumed.get("engine"), engines)))
    return assumption_rows(assumed)


def sweep_rays(dataset: xr.Dataset) -> Rows:
    """Rays of all poses by outcome, and fractions of those that did not miss."""
    whole = dataset.sel(region="part")
    counts = {
        status: int(np.maximum(whole[f"rays_{status.key}"].values, 0).sum()) for status in Status
    }
    return tuple((outcome.capitalize(), *numbers) for outcome, *numbers in ray_rows(counts))


def ray_rows(counts: Mapping[Status, int]) -> Rows:
    """Each outcome of rays that occurs, its number, and its fraction of those that did not miss."""
    met = max(1, sum(counts.values()) - counts[Status.MISSED])
    return tuple(
        (status.text, f"{count:,}", "" if status is Status.MISSED else percent(count, met))
        for status, count in counts.items()
        if count
    )


def sweep_limits(dataset: xr.Dataset, summary: SweepSummary) -> tuple[str, ...]:
    """What poses of a sweep do not see, and what is not known of others."""
    plan = summary.plan
    good = np.asarray(dataset.sel(region="part")["rays_good"].values)
    failed = sum(bool(str(text)) for text in dataset["failure"].values)
    empty = int(np.count_nonzero((good >= 0) & (good < plan.criteria.min_hits)))
    passed = int(np.maximum(dataset["rays_open_boundary"].values, 0).sum())
    seen = max(1, int(np.maximum(good, 0).sum()))
    area = dataset["face_area"].values
    unseen = area[dataset["face_times_seen"].values == 0].sum() / area.sum()
    return (
        f"{len(plan.unranked)} of {len(good)} poses are not ranked; {failed} failed and {empty} "
        f"see fewer than {plan.criteria.min_hits} good rays of the part.",
        f"{passed:,} good rays ({100 * passed / seen:.3g} %) pass an open end of the data, where "
        "the plume beyond is not modelled.",
        f"{100 * unseen:.1f} % of the part's area is seen by no pose.",
        *plan.warnings,
        "The ranking compares the poses of this sweep only; a refined plan may find a better one "
        "between them.",
    )


def measured(values: JsonObject) -> Rows:
    """What was measured or simulated, and when."""
    cloud, system = values.get("cloud", {}), values["system"]
    text = f"{values['points']['measured']:,} points by {_SYSTEMS.get(system, system)}"
    if cloud.get("path"):
        text = f"{name_of(cloud)}, saved {cloud['saved']}: {text}"
    elif not cloud:
        text = f"simulated: {text}"
    return ("Part", name_of(values["part"])), ("Measured", text)


_SYSTEMS = {"stereo": "two cameras", "fringe": "fringe projection", "laser": "a laser's line"}


def assumed(values: JsonObject) -> tuple[str, ...]:
    """Assumptions that a result does not test, a sentence each."""
    texts = (str(values["assumptions"].get(key) or "") for key in ("open_boundary", "exposure"))
    return tuple(f"{text[0].upper()}{text[1:]}." for text in texts if text)


def scan_setting(values: JsonObject) -> Rows:
    """Part, field, scene and devices of a scan or correction, from its JSON values."""
    if "ensemble" in values:
        members = sorted(values["ensemble"]["members"], key=lambda member: -member["weight"])
        listed = "; ".join(
            f"{member['weight']:.3f} {member['label']}" for member in members if member["weight"]
        )
        field = ("Fields by weight", listed)
    else:
        field = ("Field", file_text(values["field"] or {}))
    cloud = values.get("cloud", {})
    return (
        ("Part", file_text(values["part"])),
        *((("Measured cloud", file_text(cloud)),) if cloud.get("path") else ()),
        field,
        ("Scene", file_text(values["scene"])),
        ("Sensor", values["system"]),
        *_devices(values),
        ("Mitsuba variant", str(values["variant"])),
    )


def _devices(values: JsonObject) -> Rows:
    """Where the devices of a simulated measurement stand, and the angle of their lines."""
    if "devices" not in values:
        return ()
    both = [values["devices"][name] for name in ("camera", "second")]
    texts = [f"{place_text(device)}; {camera_text(device)}" for device in both]
    places = ([row[3] for row in device["matrix"][:3]] for device in both)
    texts.append(f"{math.dist(*places):.1f} mm")
    texts.append(f"{values['angle_deg']['median']:.3g}° (median of the points)")
    names = ("Camera", "Second device", "Distance of both", "Angle of both lines of sight")
    return tuple(zip(names, texts, strict=True))

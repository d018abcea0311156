"""What a sweep keeps of each pose's metrics: names, units and descriptions, and the variables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np

from iriftrace.image.aov_image import Status

Limits = tuple[float, float]
"""Least and greatest value of a colour scale."""

# Name in the file: (keys in the pose metrics, unit, description).
MEASURES: dict[str, tuple[tuple[str, ...], str, str]] = {
    **{
        f"displacement_{key}": (("displacement_mm", key), "mm", f"{text} displacement")
        for key, text in (
            ("mean", "mean"),
            ("median", "median"),
            ("p95", "95th percentile of the"),
            ("max", "largest"),
            ("rms", "root mean square"),
        )
    },
    "displacement_lateral": (("displacement_lateral_mm",), "mm", "mean across the line of sight"),
    "displacement_axial": (("displacement_axial_mm",), "mm", "mean along the line of sight"),
    **{
        f"shift_{key}": (("shift_px", key), "px", f"{key} shift in the picture")
        for key in ("mean", "median", "p95", "max")
    },
    **{
        f"{direction}_resolution{reading}": (
            (f"{direction}_resolution_mm{reading}",),
            "mm",
            f"{direction} resolution, {text}",
        )
        for direction in ("lateral", "axial")
        for reading, text in (
            ("", "step to the next pixel"),
            ("_nn3d", "nearest neighbour in space"),
            ("_nnxy", "nearest neighbour in the picture's plane"),
        )
    },
    "incidence_angle": (("incidence_angle_deg",), "degree", "mean angle of incidence"),
    "coverage": (("coverage",), "1", "area of the faces hit over the area"),
    "coverage_area": (("coverage_area",), "1", "area of the pixels' footprints over the area"),
}

# Of an ensemble only; the other displacements are then those of the members' mean.
ENSEMBLE_MEASURES: dict[str, tuple[tuple[str, ...], str, str]] = {
    f"scatter_{key}": (
        ("ensemble", "scatter_mm", key),
        "mm",
        f"{text} standard deviation of the displacement over the members",
    )
    for key, text in (
        ("mean", "mean"),
        ("median", "median"),
        ("p95", "95th percentile of the"),
        ("max", "largest"),
        ("rms", "root mean square"),
    )
}
ENSEMBLE_COUNTS = {
    "ensemble_members": (("ensemble", "members"), "members of the ensemble"),
    "rays_in_all": (("ensemble", "rays_in_all"), "rays that count in all members"),
    "rays_in_some": (("ensemble", "rays_in_some"), "rays that count in some members only"),
}
MEAN_OVER_MEMBERS = {"cell_methods": "realization: mean"}
SCATTER_OF_MEMBERS = {"cell_methods": "realization: standard_deviation"}
"""As the CF conventions (1.11, section 7.3) say it."""

COUNTS = ("hit", *(status.key for status in Status))
POSE_COUNTS = {
    "rays_launched": ("rays", "launched"),
    "rays_open_boundary": ("rays", "open_boundary"),
    "shell_triangles_in_view": ("shell_triangles_in_view",),
}
POSE_NUMBERS = {
    "every_second_shell_p95": (
        ("every_second_shell", "p95_share"),
        "1",
        "change of the hits without every second shell, 95th percentile, over the displacement's",
    ),
}
STAGES = ("straight", "refracted", "metrics", "total")


def metric_variables(
    entries: Iterable[dict[str, Any]],
    count: int,
    region_names: Sequence[str],
    *,
    ensemble: bool = False,
) -> dict[str, Any]:
    """What was measured in each pose, as variables of a dataset.

    Parameters
    ----------
    entries : iterable of dict
        For each pose ``metrics`` (of `iriftrace.image.metrics.pose_metrics`, or None)
        and ``failure``; only one is in memory at a time.
    count : int
        Number of poses.
    region_names : sequence of str
        Of the part; the whole part comes first as region ``"part"``.
    ensemble : bool
        Whether poses are those of several fields; adds their scatter.
    """
    shape = (count, 1 + len(region_names))
    wanted = {**MEASURES, **(ENSEMBLE_MEASURES if ensemble else {})}
    measures = {name: np.empty(shape) for name in wanted}
    counts = {f"rays_{key}": np.empty(shape, dtype=np.int64) for key in COUNTS}
    members = {name: np.empty(shape, dtype=np.int64) for name in ENSEMBLE_COUNTS if ensemble}
    pose_counts = {name: np.empty(count, dtype=np.int64) for name in POSE_COUNTS}
    pose_numbers = {name: np.empty(count) for name in POSE_NUMBERS}
    times = {stage: np.empty(count) for stage in STAGES}
    failures = []
    for pose, entry in enumerate(entries):
        failures.append(entry["failure"])
        for region, view in enumerate(_views(entry["metrics"], region_names)):
            for name, (keys, _, _) in wanted.items():
                measures[name][pose, region] = _number(_at(view, keys))
            for key in COUNTS:
                counts[f"rays_{key}"][pose, region] = _count(_at(view, ("rays", key)))
            for name, values in members.items():
                values[pose, region] = _count(_at(view, ENSEMBLE_COUNTS[name][0]))
        for name, keys in POSE_COUNTS.items():
            pose_counts[name][pose] = _count(_at(entry["metrics"], keys))
        for name, (keys, _, _) in POSE_NUMBERS.items():
            pose_numbers[name][pose] = _number(_at(entry["metrics"], keys))
        for stage in STAGES:
            times[stage][pose] = _number(_at(entry["metrics"], ("time_s", stage)))
    both = ("pose", "region")
    return {
        **{
            name: (
                both,
                measures[name],
                {"units": unit, "long_name": text, **_method(name, ensemble)},
            )
            for name, (_, unit, text) in wanted.items()
        },
        **{
            name: (both, values, {"units": "1", "long_name": ENSEMBLE_COUNTS[name][1]})
            for name, values in members.items()
        },
        **{name: (both, values, {"units": "1"}) for name, values in counts.items()},
        **{name: (("pose",), values, {"units": "1"}) for name, values in pose_counts.items()},
        **{
            name: (("pose",), pose_numbers[name], {"units": unit, "long_name": text})
            for name, (_, unit, text) in POSE_NUMBERS.items()
        },
        **{f"time_{stage}": (("pose",), times[stage], {"units": "s"}) for stage in STAGES},
        "failure": (("pose",), np.array(failures, dtype=object)),
    }


def _method(name: str, ensemble: bool) -> dict[str, str]:
    """What was done over the members of an ensemble."""
    if not ensemble:
        return {}
    if name in ENSEMBLE_MEASURES:
        return SCATTER_OF_MEMBERS
    return MEAN_OVER_MEMBERS if name.startswith(("displacement_", "shift_")) else {}


def _views(
    metrics: dict[str, Any] | None, region_names: Sequence[str]
) -> Iterator[dict[str, Any] | None]:
    yield metrics
    for name in region_names:
        yield None if metrics is None else metrics["regions"].get(name)


def _at(values: dict[str, Any] | None, keys: tuple[str, ...]) -> Any:
    for key in keys:
        if values is None:
            return None
        values = values.get(key)
    return values


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)


def _count(value: Any) -> int:
    return -1 if value is None else int(value)

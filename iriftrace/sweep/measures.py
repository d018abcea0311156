"""Variables of a sweep that come from the metrics of its poses: names, units, descriptions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import Variables
from iriftrace.core.plain import JsonObject
from iriftrace.image.aov_image import Status
from iriftrace.image.resolution import STEP
from iriftrace.tracing.engine import CHANGE

Limits = tuple[float, float]
"""Least and greatest value of a scale."""


@frozen
class Measure:
    """One variable; the keys lead to its value in a pose's metrics.

    A count is a whole number, -1 if it is unknown; others are floats and NaN. A regional measure
    has a value for each region as well as for the whole part. The method is the statistic over the
    members of an ensemble, in the words of the CF conventions (1.11, section 7.3).
    """

    keys: tuple[str, ...]
    unit: str
    text: str = ""
    count: bool = False
    regional: bool = True
    method: str = ""

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of the variable in the file."""
        given = {"units": self.unit, "long_name": self.text, "cell_methods": self.method}
        return {name: text for name, text in given.items() if text}

    def value(self, metrics: JsonObject | None) -> float:
        """The value in the metrics of a pose or region; None for one that failed."""
        found: Any = metrics
        for key in self.keys:
            found = None if found is None else found.get(key)
        return (-1 if self.count else np.nan) if found is None else found


_STATISTICS = (
    ("mean", "mean"),
    ("median", "median"),
    ("p95", "95th percentile of the"),
    ("max", "largest"),
    ("rms", "root mean square"),
)
MEASURES: dict[str, Measure] = {
    **{
        f"displacement_{key}": Measure(("displacement_mm", key), "mm", f"{text} displacement")
        for key, text in _STATISTICS
    },
    **{
        f"displacement_{key}": Measure(
            ("displacement_mm", key), "mm", f"{key[1:]}th percentile of the displacement"
        )
        for key in ("p25", "p75")
    },
    **{
        f"displacement_{direction}": Measure(
            (f"displacement_{direction}_mm",), "mm", f"mean {where} the line of sight"
        )
        for direction, where in (("lateral", "across"), ("axial", "along"))
    },
    **{
        f"shift_{key}": Measure(("shift_px", key), "1", f"{key} shift in the picture, pixels")
        for key in ("mean", "median", "p95", "max")
    },
    **{
        f"{direction}_resolution": Measure(
            (f"{direction}_resolution_mm",), "mm", f"{direction} resolution, {STEP}"
        )
        for direction in ("lateral", "axial")
    },
    "incidence_angle": Measure(("incidence_angle_deg",), "degree", "mean angle of incidence"),
    "coverage_area": Measure(("coverage_area",), "1", "area seen over the area"),
    "coverage": Measure(("coverage",), "1", "area of the faces hit over the area"),
}

ENSEMBLE: dict[str, Measure] = {
    **{
        f"scatter_{key}": Measure(
            ("ensemble", "scatter_mm", key),
            "mm",
            f"{text} standard deviation of the displacement over the members",
            method="realization: standard_deviation",
        )
        for key, text in _STATISTICS
    },
    **{
        f"worst_{key}": Measure(
            ("ensemble", "worst_mm", key),
            "mm",
            f"{text} displacement by the worst member in each pixel",
            method="realization: maximum",
        )
        for key, text in _STATISTICS
    },
    **{
        name: Measure(("ensemble", key), "1", text, count=True)
        for name, key, text in (
            ("ensemble_members", "members", "members of the ensemble"),
            ("worst_member", "worst_member", "member that is the worst in most pixels"),
            ("rays_in_all", "rays_in_all", "rays that count in all members"),
            ("rays_in_some", "rays_in_some", "rays that count in some members only"),
        )
    },
}
"""Only for an ensemble; the other displacements are then those of the members' mean."""

RIG: dict[str, Measure] = {
    **{
        f"error_normal_{key}": Measure(
            ("scan", "error_normal_mm", key), "mm", f"{text} of measured points along the normal"
        )
        for key, text in (
            ("mean", "mean size of the error"),
            ("median", "median size of the error"),
            ("p95", "95th percentile of the size of the error"),
            ("rms", "root mean square error"),
            ("bias", "median error, with its sign,"),
        )
    },
    **{
        f"error_normal_scatter_{key}": Measure(
            ("scan", "scatter_normal_mm", key),
            "mm",
            f"{text} standard deviation of that error over the members",
        )
        for key, text in _STATISTICS[:3]
    },
    "size_scatter": Measure(
        ("scan", "size_scatter_mm"), "mm", "standard deviation of that diameter over the members"
    ),
    "size_error": Measure(
        ("scan", "size_mm"), "mm", "error of the region's diameter; of the whole part the largest"
    ),
    "coverage_measured": Measure(
        ("scan", "coverage"), "1", "area that both devices see over the area"
    ),
    "points_lost": Measure(
        ("scan", "lost"), "1", "points whose rays are lost", count=True, regional=False
    ),
    "points_measured": Measure(("scan", "points"), "1", "points that both devices see", count=True),
}
"""Only for a sensor with two devices."""

RAYS: dict[str, Measure] = {
    **{
        f"rays_{key}": Measure(("rays", key), "1", count=True)
        for key in ("hit", *(status.key for status in Status))
    },
    **{
        f"rays_{key}": Measure(("rays", key), "1", count=True, regional=False)
        for key in ("launched", "open_boundary")
    },
}
OF_POSES: dict[str, Measure] = {
    **{
        name: Measure((name,), "1", text, count=True, regional=False)
        for name, text in (
            ("hits_at_border", "straight rays of the outermost pixels that hit the part"),
            ("triangles_in_view", ""),
        )
    },
    "engine_test_p95": Measure(
        ("engine_test", "p95_share"), "1", f"{CHANGE}, over the displacement's", regional=False
    ),
    "engine_test_p95_mm": Measure(("engine_test", "p95_mm"), "mm", CHANGE, regional=False),
    "through_cells": Measure(
        ("engine_test", "through_cells"),
        "1",
        "1 where the field's cells bend the rays instead",
        regional=False,
    ),
    **{
        f"time_{stage}": Measure(("time_s", stage), "s", regional=False)
        for stage in ("straight", "refracted", "metrics", "total")
    },
}


def metric_variables(
    entries: Iterable[JsonObject],
    count: int,
    region_names: Sequence[str],
    *,
    ensemble: bool = False,
    rig: bool = False,
) -> Variables:
    """Variables of a dataset from the metrics of each of `count` poses.

    The entries, of which only one is in memory at a time, have ``metrics`` (the JSON of a pose,
    or None) and ``failure``. The whole part comes before its regions. Scatter is added if the
    poses are those of an ensemble of fields, measured values if they are those of two devices.
    """
    measures = {
        **MEASURES,
        **(ENSEMBLE if ensemble else {}),
        **(RIG if rig else {}),
        **RAYS,
        **OF_POSES,
    }
    regions = 1 + len(region_names)
    values = {
        name: np.empty(
            (count, regions) if one.regional else count, dtype=np.int64 if one.count else np.float64
        )
        for name, one in measures.items()
    }
    failures = []
    for pose, entry in enumerate(entries):
        failures.append(entry["failure"])
        whole = entry["metrics"]
        views = [whole, *((whole or {}).get("regions", {}).get(name) for name in region_names)]
        for name, one in measures.items():
            found = [one.value(view) for view in views] if one.regional else one.value(whole)
            values[name][pose] = found
    dimensions = ("pose", "region")
    variables: Variables = {}
    for name, one in measures.items():
        attributes = one.attributes
        if ensemble and name.startswith(("displacement_", "shift_")):
            attributes["cell_methods"] = "realization: mean"
        variables[name] = (dimensions[: values[name].ndim], values[name], attributes)
    variables["failure"] = (("pose",), np.array(failures, dtype=object))
    return variables

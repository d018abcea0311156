"""A refined pose as JSON."""

from __future__ import annotations

import json
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.pose_text import look_at_of
from iriftrace.sweep_origin import attribute
from iriftrace.whole_file import whole_file

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.planning import Plan
    from iriftrace.refine import Refinement

SCHEMA = "iriftrace.refined/1"


def write_refined(path: Path, refined: Refinement, plan: Plan, dataset: xr.Dataset) -> None:
    """Write a refined pose, how it was found and what it is worth.

    Parameters
    ----------
    path
        The file; an existing one is replaced when the new one is complete.
    refined
        The result of :func:`iriftrace.refine.refine_pose`.
    plan, dataset
        The ranking and the sweep from which the search went out.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    origin, target, up = look_at_of(refined.matrix, refined.distance_mm)
    content = {
        "schema": SCHEMA,
        "version": version("iriftrace"),
        "length_unit": "mm",
        "wavelength_nm": _wavelength(dataset),
        "convention": "camera to world; x right, y down, z forward",
        "matrix": refined.matrix.tolist(),
        "look_at": {"origin": origin.tolist(), "target": target.tolist(), "up": up.tolist()},
        "distance_mm": refined.distance_mm,
        "score": refined.score,
        "metrics": refined.metrics,
        "start": {
            "pose": refined.start,
            "matrix": np.asarray(dataset["matrix"].values[refined.start]).tolist(),
            "score": refined.start_score,
            "metrics": refined.start_metrics,
        },
        "gain": refined.gain,
        "evaluations": refined.evaluations,
        "converged": refined.converged,
        "ranking": {
            "weights": plan.weights.as_dict(),
            "limits": {name: list(limits) for name, limits in plan.limits.items()},
            "percentile": plan.percentile,
            "statistic": plan.statistic,
            "resolution": plan.resolution,
            "region": plan.region,
            "outside": plan.outside,
            "min_hits": plan.min_hits,
            "min_coverage": plan.min_coverage,
        },
        "scene": attribute(dataset, "scene"),
    }
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def _wavelength(dataset: xr.Dataset) -> float | None:
    """Of the light of the sweep, nm; None where it is not stated."""
    stated = dataset.attrs.get("wavelength_nm")
    return float(stated) if isinstance(stated, int | float) else None

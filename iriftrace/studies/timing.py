"""Studies that compare times: each stage of a picture along an axis, in each mode."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np
from attrs import frozen

from iriftrace.scene.load import LoadedScene
from iriftrace.studies.cases import Entry, run_cases
from iriftrace.studies.hit_comparison import Axis, attributes
from iriftrace.studies.modes import Mode
from iriftrace.studies.picture import rendered
from iriftrace.trace.query_replay import Recording, free_memory

if TYPE_CHECKING:
    import xarray as xr


STAGES = {
    "load": "reading the scene and building the acceleration structure",
    "build": "building the tables and finding the layer at the wall",
    "straight": "straight trace",
    "refracted": "refracted trace",
    "search": "intersection search of the refracted trace alone: its queries replayed",
    "refraction": "what the refracted trace takes beside its search",
    "metrics": "reduction to metrics",
    "write": "writing the EXR",
}
IN_METRICS = ("load", "build", "straight", "metrics", "write")
"""Stages whose times come with each picture; that of the refracted trace comes with its search."""

COUNTS = {
    "rays": "rays launched",
    "rays_refracted": "rays that are refracted",
    "triangles": "triangles of all shells",
    "triangles_per_shell": "triangles per shell, mean",
    "process": "number of the process that measured",
}
REPEATS = 5
"""Times each picture is traced after the first, which compiles the kernels.

The fastest counts: other programs on the machine can only make it slower.
"""


@frozen(eq=False)
class Timing:
    """A study that compares times.

    Attributes
    ----------
    name : str
        ``"rays"`` or ``"polygons"``.
    axis : Axis
    modes : tuple of Mode
    scene : callable
        From a mode and a position on the axis to a context with the loaded scene and the number of
        its shells.
    source : mapping
        Provenance, plain JSON values.
    """

    name: str
    axis: Axis
    modes: tuple[Mode, ...]
    scene: Callable[[Mode, int], AbstractContextManager[tuple[LoadedScene, int, int]]]
    source: Mapping[str, Any]

    @property
    def request(self) -> dict[str, Any]:
        """What tells this study from another."""
        return {
            "study": self.name,
            "axis": [self.axis.name, list(self.axis.values)],
            "modes": [mode.as_dict() for mode in self.modes],
            **self.source,
        }


def run_timing(
    study: Timing, path: str | Path, progress: Callable[[int, int], None] | None = None
) -> xr.Dataset:
    """Time every case and write the result.

    Returns
    -------
    xarray.Dataset
        ``time_...`` of `STAGES` and `COUNTS` over mode and axis. ``search_share``: the search's
        part of the refracted trace, the median of pairs that were measured one right after the
        other; more than 1 is noise. Times of cases with another ``process`` come from another run
        of the program.
    """
    length = len(study.axis.values)

    def measure(number: int) -> Entry:
        free_memory()
        with study.scene(study.modes[number // length], number % length) as (scene, *counts):
            return {**_times(scene), **_counts(scene, *counts)}

    return run_cases(
        Path(path),
        study.request,
        len(study.modes) * length,
        measure,
        lambda entries: _dataset(study, entries),
        progress,
    )


def _times(scene: LoadedScene) -> dict[str, float | int]:
    pictures = []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(REPEATS + 1):
            picture = rendered(scene)
            picture.save(Path(folder) / "picture.exr")
            pictures.append(picture.metrics)
    # The first picture compiles the kernels.
    fastest = {
        stage: min(metrics["time_s"][stage] for metrics in pictures[1:]) for stage in IN_METRICS
    }
    recording = Recording(scene)
    pairs = recording.time_pairs(REPEATS)
    share = median(pair.queries_s / pair.trace_s for pair in pairs)
    trace = min(pair.trace_s for pair in pairs)
    return {
        **{f"time_{stage}": seconds for stage, seconds in fastest.items()},
        "time_refracted": trace,
        "time_search": share * trace,
        "time_refraction": (1.0 - share) * trace,
        "search_share": share,
        "rays": pictures[0]["rays"]["launched"],
        "rays_refracted": recording.rays,
    }


def _counts(scene: LoadedScene, shells: int, triangles: int) -> dict[str, float | int]:
    return {
        "triangles": triangles,
        "triangles_per_shell": triangles // shells,
        "process": os.getpid(),
    }


def _dataset(study: Timing, entries: Sequence[Entry]) -> xr.Dataset:
    import xarray as xr

    over = ("mode", study.axis.name)
    shape = (len(study.modes), len(study.axis.values))

    def over_cases(name: str, kind: type) -> Any:
        return np.array([entry[name] for entry in entries], dtype=kind).reshape(shape)

    return xr.Dataset(
        {
            **{
                f"time_{stage}": (
                    over,
                    over_cases(f"time_{stage}", np.float64),
                    {"units": "s", "long_name": text},
                )
                for stage, text in STAGES.items()
            },
            "search_share": (
                over,
                over_cases("search_share", np.float64),
                {"units": "1", "long_name": "search / refracted trace, median of pairs"},
            ),
            **{
                name: (over, over_cases(name, np.int64), {"units": "1", "long_name": text})
                for name, text in COUNTS.items()
            },
        },
        coords={
            "mode": np.array([mode.name for mode in study.modes], dtype=object),
            "mode_description": (
                ("mode",),
                np.array([mode.describe() for mode in study.modes], dtype=object),
            ),
            study.axis.name: (
                (study.axis.name,),
                np.array(study.axis.values),
                {"long_name": study.axis.long_name, "units": study.axis.units},
            ),
        },
        attrs={
            "study": study.name,
            "repeats": REPEATS,
            **attributes({"modes": [m.as_dict() for m in study.modes], **study.source}),
        },
    )

"""A study: one attribute of a scene varied in several modes, traced, and compared or timed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from attrs import asdict, field, frozen

from iriftrace.core.errors import InputError
from iriftrace.core.files import check_readable, whole_file
from iriftrace.core.netcdf import check_netcdf
from iriftrace.field.index_field import IndexField
from iriftrace.image.differences import Hits, compare, hits_of, own_size
from iriftrace.image.metrics import FEWEST_RAYS
from iriftrace.scene.scene import Scene
from iriftrace.studies.mode import Mode
from iriftrace.studies.times import COUNTS, REPEATS, STAGES, rendered, times
from iriftrace.sweep.journal import Journal, Piece, Progress, Work
from iriftrace.sweep.pose import fingerprint
from iriftrace.trace.query_replay import free_memory

if TYPE_CHECKING:
    import xarray as xr

SCHEMA = "iriftrace.study/1"

SAME_MODE = "same mode"
BY_CELLS = "cells"
CELLS = {BY_CELLS: "gradient", "linear cells": "facet"}
"""References: shells of the finest field in a case's own mode, the cells engine, and the same
with one gradient in each cell, to which facet normals converge."""

Variables = Mapping[str, tuple[str, type, str]]
"""Unit, type and description by name; counts that do not exist are -1, other numbers NaN."""

DIFFERENCES: Variables = {
    "rmse": ("mm", float, "root of the mean squared distance of the refracted hits"),
    "rmse_trimmed": ("mm", float, "the same without the 1 % of rays that differ most"),
    "median": ("mm", float, "median distance of the refracted hits"),
    "p95": ("mm", float, "95th percentile of the distance of the refracted hits"),
    "matched": ("1", int, "rays good in both runs"),
    "only_here": ("1", int, "rays good in this run only"),
    "only_reference": ("1", int, "rays good in the reference only"),
}
SIZES: Variables = {
    "displacement_median": ("mm", float, "median displacement of this run"),
    "displacement_p95": ("mm", float, "95th percentile of the displacement of this run"),
    "displacement_rms": ("mm", float, "root mean square displacement of this run"),
    "rays_good": ("1", int, "rays with status 0"),
    "rays_lost": ("1", int, "rays whose straight twin hits the part, but which are not good"),
    "shells": ("1", int, "shells that are not empty"),
    "triangles": ("1", int, "triangles of all shells"),
}
TIMES: Variables = {
    **{f"time_{stage}": ("s", float, text) for stage, text in STAGES.items()},
    "search_share": ("1", float, "search / refracted trace, median of pairs"),
    **{name: ("1", int, text) for name, text in COUNTS.items()},
}


@frozen(eq=False)
class Study:
    """Cases along an axis, in each mode.

    Attributes
    ----------
    name : str
    axis, values, long_name : str, tuple, str
        What is varied: dimension in the file, numbers or names, and its name in figures.
    modes : tuple of Mode
    template : Scene
        Its part, camera, variant and notes are in the file.
    scene : callable
        From a mode and a position on the axis to the scene, or None where no shell is left.
    fields : tuple of IndexField
    more : mapping
        Options of the study for the file.
    references : tuple of str
        Hits are compared with these; without them times are measured.
    reference : callable
        From a mode and the name of a reference to its scene, or None where no shell is left.
    """

    name: str
    axis: str
    values: tuple[Any, ...]
    long_name: str
    modes: tuple[Mode, ...]
    template: Scene
    scene: Callable[[Mode, int], Scene | None]
    fields: tuple[IndexField, ...]
    more: Mapping[str, Any] = field(factory=dict)
    references: tuple[str, ...] = ()
    reference: Callable[[Mode, str], Scene | None] = lambda mode, name: None

    def __attrs_post_init__(self) -> None:
        """Refuse what would be compared with nothing."""
        for what, some, fewest in (
            ("modes", [mode.name for mode in self.modes], 1),
            (self.axis, list(self.values), 1),
            ("references", list(self.references), 0),
        ):
            if len(some) < fewest or len(set(some)) != len(some):
                raise InputError(
                    f"The study's {what} are {', '.join(map(str, some)) or 'none'}; give at least "
                    "one, each once."
                )

    @property
    def source(self) -> dict[str, Any]:
        """Where the study comes from, as plain JSON values."""
        air = self.fields[0].air
        return {
            "version": version("iriftrace"),
            "fields": [asdict(one.source) for one in self.fields],
            "part": {"path": str(self.template.part.path), "sha256": self.template.part.sha256},
            "air": asdict(air),
            "wavelength_nm": air.wavelength_nm,
            "camera": self.template.camera.as_dict(),
            "notes": dict(self.template.air.notes),
            "variant": self.template.variant,
            "length_unit": "mm",
            **self.more,
        }


def run_study(study: Study, path: str | Path, progress: Progress | None = None) -> xr.Dataset:
    """Trace every case, compare or time it, and write the result.

    Finished cases go into a journal: the same call continues where an earlier one was interrupted.
    References are traced when the first case needs them.

    Parameters
    ----------
    study : Study
    path : path
        The netCDF file. If it exists and holds the same study, it is read and nothing is done.
    progress : callable, optional
        Called with the number of finished cases and of all cases.

    Returns
    -------
    xarray.Dataset
        With references ``SIZES`` over mode and axis, and ``DIFFERENCES`` over reference too: NaN
        (-1 for counts) where no shell is left. Else ``TIMES`` over mode and axis:
        ``search_share`` is the search's fraction of the refracted trace, the median of pairs that
        were measured one right after the other (more than 1 is noise); times of cases with another
        ``process`` come from another run of the program.

    Raises
    ------
    InputError
        If fewer than 100 rays of a compared case are good, a case to be timed has no shell, the
        file cannot be written, or it belongs to another study.
    """
    identity = {
        "study": study.name,
        "axis": [study.axis, list(study.values)],
        "modes": [asdict(mode) for mode in study.modes],
        "references": list(study.references),
        **study.source,
    }
    work = Work(
        kind="study",
        parts="files or options",
        output=Path(path),
        request=fingerprint(version("iriftrace"), identity),
        total=len(study.values) * len(study.modes),
    )
    measure = _compared(study) if study.references else _timed(study)

    def left(journal: Journal) -> Iterator[Piece]:
        for number in range(work.total):
            if number not in journal:
                # All modes at one place, because what is made for a place may be large.
                position, mode = divmod(number, len(study.modes))
                yield Piece(number, measure(study.modes[mode], position))

    def write(journal: Journal) -> None:
        dataset = _dataset(study, [journal.entry(number) for number in range(work.total)])
        dataset.attrs |= {"schema": SCHEMA, "request": work.request}
        with whole_file(path) as temporary:
            dataset.to_netcdf(temporary, engine="h5netcdf")

    return work.run(left, write, read_study, progress)


def picture(scene: Scene) -> Hits:
    """Trace the picture of a scene of one field."""
    stack = scene.air.states[0].shells
    return hits_of(rendered(scene).image, len(stack.shells), stack.triangles)


Measure = Callable[[Mode, int], dict[str, Any]]


def _compared(study: Study) -> Measure:
    @cache
    def reference(mode: Mode, name: str) -> Hits | None:
        scene = study.reference(mode, name)
        return None if scene is None else picture(scene)

    def measure(mode: Mode, position: int) -> dict[str, Any]:
        scene = study.scene(mode, position)
        if scene is None:
            return {"values": None, "differences": [None for _ in study.references]}
        hits = picture(scene)
        del scene
        good, rays = int(hits.good.sum()), len(hits.good)
        if good < FEWEST_RAYS:
            raise InputError(
                f"Only {good} of the {rays:,} rays of the study's picture are good, but its "
                f"numbers rest on at least {FEWEST_RAYS}; give more pixels (--scale), or let the "
                "camera look at the part."
            )
        # The engine of cells knows no mode.
        others = [
            reference(study.modes[0] if name in CELLS else mode, name) for name in study.references
        ]
        differences = [
            None if other is None else compare(hits, other).as_dict() for other in others
        ]
        return {"values": own_size(hits), "differences": differences}

    return measure


def _timed(study: Study) -> Measure:
    def measure(mode: Mode, position: int) -> dict[str, Any]:
        free_memory()
        scene = study.scene(mode, position)
        if scene is None:
            raise InputError(
                f"The mode '{mode.name}' leaves no shell that the field reaches; give more layers, "
                "or leave fewer inner ones out."
            )
        return {"values": times(scene), "differences": []}

    return measure


def _dataset(study: Study, entries: Sequence[dict[str, Any]]) -> xr.Dataset:
    import xarray as xr

    shape = (len(study.values), len(study.modes))
    texts = any(isinstance(value, str) for value in study.values)

    def variables(
        known: Variables, rows: Sequence[Mapping[str, Any] | None], over: Sequence[str]
    ) -> dict[str, Any]:
        columns = {
            name: [(-1 if kind is int else np.nan) if row is None else row[name] for row in rows]
            for name, (_, kind, _) in known.items()
        }
        sizes = (*shape, len(study.references))[: len(over)]
        return {
            name: (
                over,
                np.array(columns[name], dtype=kind).reshape(sizes),
                {"units": unit, "long_name": text},
            )
            for name, (unit, kind, text) in known.items()
        }

    over = (study.axis, "mode")
    cases = [entry["values"] for entry in entries]
    pairs = [pair for entry in entries for pair in entry["differences"]]
    values = np.array(study.values, dtype=object if texts else None)
    described = np.array([mode.describe() for mode in study.modes], dtype=object)
    coords: dict[str, Any] = {
        "mode": np.array([mode.name for mode in study.modes], dtype=object),
        "mode_description": ("mode", described),
        study.axis: (
            study.axis,
            values,
            {"long_name": study.long_name, **({} if texts else {"units": "1"})},
        ),
    }
    attrs: dict[str, Any] = {
        "study": study.name,
        "modes": json.dumps([asdict(mode) for mode in study.modes]),
    }
    if study.references:
        coords["reference"] = np.array(study.references, dtype=object)
        columns = variables(SIZES, cases, over) | variables(
            DIFFERENCES, pairs, (*over, "reference")
        )
    else:
        attrs["repeats"] = REPEATS
        columns = variables(TIMES, cases, over)
    for key, value in study.source.items():
        attrs[key] = value if isinstance(value, str | int | float) else json.dumps(value)
    return xr.Dataset(columns, coords, attrs).transpose("mode", study.axis, ...)


def read_study(path: str | Path) -> xr.Dataset:
    """Read a study that :func:`run_study` wrote.

    Raises
    ------
    InputError
        If the file is missing, no netCDF, or of another program.
    """
    import xarray as xr

    if not Path(path).is_file():
        raise InputError(f"There is no study {path}; `iriftrace study` writes one.")
    check_readable(Path(path))
    check_netcdf(Path(path))
    try:
        with xr.open_dataset(path, engine="h5netcdf") as file:
            dataset: xr.Dataset = file.load()
    except Exception as error:  # xarray decodes what a damaged file states, with any error
        raise InputError(f"{path} is no netCDF file ({error}); give a study.") from error
    if dataset.attrs.get("schema") != SCHEMA:
        raise InputError(
            f"{path} has schema {dataset.attrs.get('schema')!r} instead of {SCHEMA!r}, so it is no "
            "study of this version of iriftrace; run the study again."
        )
    return dataset


def is_study(path: str | Path) -> bool:
    """True if a file is a study's and no other netCDF file."""
    import xarray as xr

    try:
        check_netcdf(Path(path))
        with xr.open_dataset(path, engine="h5netcdf") as file:
            return "study" in file.attrs
    except (OSError, ValueError, KeyError):
        return False


def reference_words(reference: str) -> str:
    """Name of a reference in figures and tables."""
    if reference.isdecimal():
        return f"{reference} shells of the same mode"
    return {
        SAME_MODE: "the finest field, same mode",
        BY_CELLS: "the cells engine",
        "linear cells": "the cells engine, linear cells",
    }[reference]

"""A study: one attribute of a scene varied in several modes, traced, and compared or timed."""

from __future__ import annotations

import gc
import importlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from attrs import asdict, evolve, field, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import AnyArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import whole_file
from iriftrace.core.plain import JsonObject, plain
from iriftrace.image.ray_statistics import FEWEST_RAYS
from iriftrace.io.netcdf import json_attributes, read_netcdf
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.sweep.journal import Journal, Piece, Progress, Work
from iriftrace.sweep.pose import fingerprint
from iriftrace.tracing.scene import Scene
from validation.paper.differences import Hits, compare, displacement_statistics, hits_of
from validation.paper.mode import Mode, check_modes, shells_of, through_cells, through_shells
from validation.paper.times import COUNTS, REPEATS, STAGES, rendered, times

if TYPE_CHECKING:
    import xarray as xr

SCHEMA = "iriftrace.study/1"

SAME_MODE = "same mode"
BY_CELLS = "cells"
CELLS = {BY_CELLS: "gradient", "linear cells": "facet"}
"""References: shells of the finest field in a case's own mode, the cells engine, and the same
with one gradient in each cell, to which facet normals converge."""

Variables = dict[str, tuple[str, type, str]]
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


@frozen
class Axis:
    """The varied quantity: dimension in the file, numbers or names, and its name in figures."""

    name: str
    values: tuple[Any, ...] = field(converter=tuple[Any, ...])
    text: str


@frozen(eq=False)
class Setup:
    """What the cases of a study have in common.

    Attributes
    ----------
    scene : Scene
        Its part, camera, variant and notes; its air is replaced.
    fields : mapping of IndexField
        Fields by name, coarse to fine.
    modes : tuple of Mode
    """

    scene: Scene
    fields: Mapping[str, IndexField]
    modes: tuple[Mode, ...] = field(converter=tuple[Mode, ...])

    @property
    def finest(self) -> IndexField:
        """The last field."""
        return list(self.fields.values())[-1]

    def shells(self, field: IndexField, layers: int, mode: Mode, number: int) -> ShellStack | None:
        """Field ``number``, from 0, cut at the levels of the finest one."""
        levels = self.finest.ambient_refractivity, self.finest.hottest_refractivity
        return shells_of(field, layers, mode, number=number, index_range=levels)


@frozen(eq=False)
class Study:
    """Cases along an axis, in each mode.

    Attributes
    ----------
    name : str
    axis : Axis
    setup : Setup
    varied : callable
        From a mode and a position on the axis to the shells, or None if none is left.
    layers : int, optional
        Number of shells, if it is not varied.
    cameras : tuple of Camera
        The camera at each position, if it is not that of the scene.
    references : tuple of str
        Hits are compared with these: one of `CELLS`, `SAME_MODE`, or a number of shells of the
        finest field in the case's own mode. Without them times are measured.
    more : mapping
        Other options of the study for the file.

    Raises
    ------
    InputError
        If modes, values or references are missing or given twice, a reference is unknown, or a
        mode leaves no shell or is for another number of fields.
    """

    name: str
    axis: Axis
    setup: Setup
    varied: Callable[[Mode, int], ShellStack | None]
    layers: int | None = None
    cameras: tuple[Camera, ...] = ()
    references: tuple[str, ...] = field(default=(), converter=tuple[str, ...])
    more: Mapping[str, Any] = field(factory=dict)

    def __attrs_post_init__(self) -> None:
        """Raise InputError for options that cannot be compared or leave nothing to trace."""
        for what, some, fewest in (
            ("modes", [mode.name for mode in self.setup.modes], 1),
            (self.axis.name, list(self.axis.values), 1),
            ("references", list(self.references), 0),
        ):
            if len(some) < fewest or len(set(some)) != len(some):
                raise InputError(
                    f"The study's {what} are {', '.join(map(str, some)) or 'none'}; give at least "
                    "one, each once.",
                    code="validation.not_each_once",
                )
        known = [*CELLS, *([] if self.layers is None else [SAME_MODE])]
        for name in self.references:
            if name not in known and not (name.isdecimal() and int(name) > 0):
                raise InputError(
                    f'"{name}" is not a reference; give {", ".join(known)} or a number of shells, '
                    "such as 20.",
                    code="validation.unknown_reference",
                )
        check_modes(self.setup.modes, len(self.setup.fields), self.layers)

    def case(self, mode: Mode, position: int) -> Scene | None:
        """Scene at a position on the axis, or None if no shell is left."""
        stack, scene = self.varied(mode, position), self.setup.scene
        if self.cameras:
            scene = evolve(scene, camera=self.cameras[position])
        return None if stack is None else through_shells(scene, stack, mode)

    def reference(self, mode: Mode, name: str) -> Scene | None:
        """Scene of a reference, or None if no shell is left."""
        scene, finest = self.setup.scene, self.setup.finest
        if name in CELLS:
            return through_cells(scene, finest, CELLS[name])
        layers = self.layers if name == SAME_MODE and self.layers else int(name)
        stack = self.setup.shells(finest, layers, mode, len(self.setup.fields) - 1)
        return None if stack is None else through_shells(scene, stack, mode)

    @property
    def source(self) -> JsonObject:
        """Name, modes and origin of the study, as plain JSON values."""
        scene, fields = self.setup.scene, list(self.setup.fields.values())
        return {
            "study": self.name,
            "modes": [asdict(mode) for mode in self.setup.modes],
            "version": version("iriftrace"),
            "fields": [plain(each.source) for each in fields],
            "part": {"path": str(scene.part.path), "sha256": scene.part.sha256},
            "air": asdict(fields[0].air),
            "wavelength_nm": fields[0].air.wavelength_nm,
            "camera": scene.camera.as_dict(),
            "notes": dict(scene.air.notes),
            "variant": scene.variant,
            "length_unit": "mm",
            **({} if self.layers is None else {"layers": self.layers}),
            **self.more,
        }


def run_study(study: Study, path: str | Path, progress: Progress | None = None) -> xr.Dataset:
    """Trace every case, compare or time it, and write the result.

    Finished cases enter a journal: the same call continues where an earlier one was interrupted.
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
        (-1 for counts) if no shell is left. Else ``TIMES`` over mode and axis:
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
        "axis": [study.axis.name, list(study.axis.values)],
        "references": list(study.references),
        **study.source,
    }
    modes = study.setup.modes
    work = Work(
        kind="study",
        parts="files or options",
        output=Path(path),
        request=fingerprint(version("iriftrace"), identity),
        total=len(study.axis.values) * len(modes),
    )
    measure = _compared(study) if study.references else partial(_timed, study)

    def left(journal: Journal) -> Iterator[Piece]:
        for number in range(work.total):
            if number not in journal:
                # All modes at one position, because the data of a position may be large.
                position, mode = divmod(number, len(modes))
                yield Piece(number, measure(modes[mode], position))

    def write(journal: Journal) -> None:
        dataset = _dataset(study, [journal.entry(number) for number in range(work.total)])
        dataset.attrs |= {"schema": SCHEMA, "request": work.request}
        with whole_file(path) as temporary:
            dataset.to_netcdf(temporary, engine="h5netcdf")

    return work.run(left, write, read_study, progress)


def picture(scene: Scene) -> Hits:
    """Trace the picture of a scene of one field."""
    return hits_of(rendered(scene).image)


Entry = JsonObject
"""Numbers of a case by the names of `SIZES` and `DIFFERENCES` (by reference), or of `TIMES`."""


def _compared(study: Study) -> Callable[[Mode, int], Entry]:
    @cache
    def reference(mode: Mode, name: str) -> Hits | None:
        scene = study.reference(mode, name)
        return None if scene is None else picture(scene)

    def measure(mode: Mode, position: int) -> Entry:
        scene = study.case(mode, position)
        if scene is None:
            return {}
        hits, stack = picture(scene), scene.air.states[0].shells
        of_stack = {"shells": len(stack.shells), "triangles": stack.triangles}
        del scene, stack
        good, rays = int(hits.good.sum()), len(hits.good)
        if good < FEWEST_RAYS:
            raise InputError(
                f"Only {good} of the {rays:,} rays of the study's picture are good, but its "
                f"numbers need at least {FEWEST_RAYS}; give more pixels (--scale), or let the "
                "camera look at the part.",
                code="validation.few_rays",
            )
        # The engine of cells has no mode.
        others = [
            reference(study.setup.modes[0] if name in CELLS else mode, name)
            for name in study.references
        ]
        pairs = [{} if other is None else compare(hits, other).as_dict() for other in others]
        differences = {name: [pair.get(name) for pair in pairs] for name in DIFFERENCES}
        return displacement_statistics(hits) | of_stack | differences

    return measure


def _timed(study: Study, mode: Mode, position: int) -> Entry:
    _free_memory()
    scene = study.case(mode, position)
    if scene is None:
        raise InputError(
            f"The mode '{mode.name}' leaves no shell that the field reaches; give more layers, or "
            "leave fewer inner ones out.",
            code="validation.no_shell",
        )
    return dict(times(scene))


def _dataset(study: Study, entries: Sequence[Entry]) -> xr.Dataset:
    """One dataset over mode and axis; attributes that are not numbers or strings become JSON."""
    import xarray as xr

    axis = study.axis
    texts = any(isinstance(value, str) for value in axis.values)
    places = np.array(axis.values, dtype=object if texts else None)
    names = [(mode.name, mode.describe()) for mode in study.setup.modes]
    modes = np.array(names, dtype=object)
    about = {"long_name": axis.text} | ({} if texts else {"units": "1"})
    coords = {
        "mode": modes[:, 0],
        "mode_description": ("mode", modes[:, 1]),
        axis.name: (axis.name, places, about),
    }
    attrs = study.source
    if study.references:
        coords["reference"] = np.array(study.references, dtype=object)
    else:
        attrs["repeats"] = REPEATS
    known = SIZES | DIFFERENCES if study.references else TIMES
    columns = {name: _column(study, entries, name, *known[name]) for name in known}
    return xr.Dataset(columns, coords, json_attributes(attrs)).transpose("mode", axis.name, ...)


def _column(
    study: Study, entries: Sequence[Entry], name: str, unit: str, kind: type, text: str
) -> tuple[list[str], AnyArray, dict[str, str]]:
    """Dimensions, values and attributes of a variable; missing values of a case are NaN or -1."""
    sizes = {study.axis.name: len(study.axis.values), "mode": len(study.setup.modes)}
    if name in DIFFERENCES:
        sizes["reference"] = len(study.references)
    # None of a case without shells is used for all references.
    rows = [np.full(list(sizes.values())[2:], entry.get(name), dtype=float) for entry in entries]
    values = np.reshape(rows, list(sizes.values()))
    if kind is int:
        values = np.where(np.isnan(values), -1, values).astype(int)
    return list(sizes), values, {"units": unit, "long_name": text}


def read_study(path: str | Path) -> xr.Dataset:
    """Read a study that :func:`run_study` wrote.

    Raises
    ------
    InputError
        If the file is missing, not netCDF, or of another program.
    """
    return read_netcdf(Path(path), "study", SCHEMA)


def reference_words(reference: str) -> str:
    """Name of a reference in figures and tables."""
    words = {
        SAME_MODE: "the finest field, same mode",
        BY_CELLS: "the cells engine",
        "linear cells": "the cells engine, linear cells",
    }
    return words.get(reference, f"{reference} shells of the same mode")


def _free_memory() -> None:
    """Free the last case's scene, whose objects refer to each other, and Dr.Jit's arrays."""
    gc.collect()
    importlib.import_module("drjit").flush_malloc_cache()

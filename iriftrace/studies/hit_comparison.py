"""Studies that compare refracted hits: some quantity along an axis, in each mode, to references."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from attrs import frozen

from iriftrace.core.errors import InputError
from iriftrace.field.index_field import IndexField
from iriftrace.image.differences import Hits, compare, own_size
from iriftrace.image.metrics import FEWEST_RAYS
from iriftrace.studies.cases import Entry, run_cases
from iriftrace.studies.modes import CONTINUOUS, Mode, shells_of
from iriftrace.studies.picture import View, picture_of_field, picture_of_shells

if TYPE_CHECKING:
    import xarray as xr


DIFFERENCES = {
    "rmse": ("mm", "root of the mean squared distance of the refracted hits"),
    "rmse_trimmed": ("mm", "the same without the 1 % of rays that differ most"),
    "median": ("mm", "median distance of the refracted hits"),
    "p95": ("mm", "95th percentile of the distance of the refracted hits"),
    "matched": ("1", "rays good in both runs"),
    "only_here": ("1", "rays good in this run only"),
    "only_reference": ("1", "rays good in the reference only"),
}
SIZES = {
    "displacement_median": ("mm", "median displacement of this run"),
    "displacement_p95": ("mm", "95th percentile of the displacement of this run"),
    "displacement_rms": ("mm", "root mean square displacement of this run"),
    "rays_good": ("1", "rays with status 0"),
    "rays_lost": ("1", "rays whose straight twin hits the part, but which are not good"),
    "shells": ("1", "shells that are not empty"),
    "triangles": ("1", "triangles of all shells"),
}


@frozen(eq=False)
class Axis:
    """What a study varies.

    Attributes
    ----------
    name : str
        Dimension in the file.
    values : tuple
        Numbers, or names.
    long_name : str
    units : str
    """

    name: str
    values: tuple[Any, ...]
    long_name: str
    units: str = "1"


@frozen(eq=False)
class Comparison:
    """A study that compares hits.

    Attributes
    ----------
    name : str
        ``"layers"``, ``"smoothing"`` or ``"mesh"``.
    axis : Axis
    modes : tuple of Mode
    references : tuple of str
        Names of the runs that each case is compared with.
    trace : callable
        From a mode and a position on the axis to the hits, or None where no shell is left.
    reference : callable
        From a mode and the name of a reference to the hits, or None likewise.
    source : mapping
        Provenance, plain JSON values: files with their SHA-256, camera, air.
    """

    name: str
    axis: Axis
    modes: tuple[Mode, ...]
    references: tuple[str, ...]
    trace: Callable[[Mode, int], Hits | None]
    reference: Callable[[Mode, str], Hits | None]
    source: Mapping[str, Any]

    def __attrs_post_init__(self) -> None:
        """Refuse what would be compared with nothing."""
        names = [mode.name for mode in self.modes]
        for what, some in (
            ("modes", names),
            (self.axis.name, list(self.axis.values)),
            ("references", list(self.references)),
        ):
            if not some or len(set(some)) != len(some):
                raise InputError(
                    f"The study's {what} are {', '.join(map(str, some)) or 'none'}; give at least "
                    "one, each once."
                )

    @property
    def request(self) -> dict[str, Any]:
        """What tells this study from another."""
        return {
            "study": self.name,
            "axis": [self.axis.name, list(self.axis.values)],
            "modes": [mode.as_dict() for mode in self.modes],
            "references": list(self.references),
            **self.source,
        }


def run_comparison(
    study: Comparison, path: str | Path, progress: Callable[[int, int], None] | None = None
) -> xr.Dataset:
    """Trace every case, compare it with every reference and write the result.

    References are traced when the first case needs them, so a study that goes on after it was
    killed traces those again that are left.

    Returns
    -------
    xarray.Dataset
        ``DIFFERENCES`` over mode, axis and reference; ``SIZES`` over mode and axis. NaN (-1 for
        counts) where no shell is left.

    Raises
    ------
    InputError
        If fewer than 100 rays of a case are good.
    """
    reference = cache(study.reference)

    def measure(number: int) -> Entry:
        # All modes at one place, because what is made for a place may be large.
        position, mode_number = divmod(number, len(study.modes))
        mode = study.modes[mode_number]
        here = study.trace(mode, position)
        if here is None:
            return {"size": None, "differences": [None for _ in study.references]}
        _refuse_few_rays(here)
        references = [reference(mode, name) for name in study.references]
        return {
            "size": own_size(here),
            "differences": [
                None if other is None else compare(here, other).as_dict() for other in references
            ],
        }

    return run_cases(
        Path(path),
        study.request,
        len(study.modes) * len(study.axis.values),
        measure,
        lambda entries: _dataset(study, entries),
        progress,
    )


def _refuse_few_rays(here: Hits) -> None:
    good, rays = int(here.good.sum()), len(here.good)
    if good < FEWEST_RAYS:
        raise InputError(
            f"Only {good} of the {rays:,} rays of the study's picture are good, but its numbers "
            f"rest on at least {FEWEST_RAYS}; give more pixels (--scale), or let the camera look "
            "at the part."
        )


def _dataset(study: Comparison, entries: Sequence[Entry]) -> xr.Dataset:
    import xarray as xr

    axis = study.axis
    over = (axis.name, "mode")
    shape = (len(axis.values), len(study.modes))
    variables: dict[str, Any] = {}
    for name, (unit, text) in SIZES.items():
        sizes = [_at(entry["size"], name) for entry in entries]
        variables[name] = (over, _array(sizes, shape, unit), {"units": unit, "long_name": text})
    for name, (unit, text) in DIFFERENCES.items():
        values = [_at(one, name) for entry in entries for one in entry["differences"]]
        variables[name] = (
            (*over, "reference"),
            _array(values, (*shape, len(study.references)), unit),
            {"units": unit, "long_name": text},
        )
    names = any(isinstance(value, str) for value in axis.values)
    places = np.array(axis.values, dtype=object if names else None)
    result = xr.Dataset(
        variables,
        coords={
            "mode": np.array([mode.name for mode in study.modes], dtype=object),
            "mode_description": (
                ("mode",),
                np.array([mode.describe() for mode in study.modes], dtype=object),
            ),
            axis.name: (
                (axis.name,),
                places,
                {"long_name": axis.long_name, **({} if names else {"units": axis.units})},
            ),
            "reference": np.array(study.references, dtype=object),
        },
        attrs={
            "study": study.name,
            "modes": json.dumps([mode.as_dict() for mode in study.modes]),
            **attributes(study.source),
        },
    )
    return result.transpose("mode", axis.name, "reference")


def reference_words(reference: str) -> str:
    """What cases are compared with, as figures and tables call it."""
    if reference.isdecimal():
        return f"{reference} shells of the same mode"
    return {
        "same mode": "the finest field, same mode",
        "continuous": "the continuous engine",
        "linear cells": "the continuous engine, linear cells",
    }[reference]


def attributes(source: Mapping[str, Any]) -> dict[str, Any]:
    """Provenance as attributes of a netCDF file: what is no number or string becomes JSON."""
    return {
        key: value if isinstance(value, str | int | float) else json.dumps(value)
        for key, value in source.items()
    }


def _at(values: Mapping[str, Any] | None, name: str) -> Any:
    return None if values is None else values[name]


def _array(values: Sequence[Any], shape: tuple[int, ...], unit: str) -> Any:
    """Values in their shape; what is missing becomes NaN, or -1 among counts."""
    missing, kind = (-1, np.int64) if unit == "1" else (np.nan, np.float64)
    filled = [missing if value is None else value for value in values]
    return np.array(filled, dtype=kind).reshape(shape)


# MERGE studies.finest: The reference of studies over several fields: the finest of them, unchange

SAME_MODE = "same mode"
"""Shells of the finest field in the case's own mode, as in Kern et al. (2025)."""


@frozen(eq=False)
class Finest:
    """The finest field of a study.

    Attributes
    ----------
    field : IndexField
    number : int
        Which of the study's fields it is, for `Mode.drop_inner`.
    layers : int
        Number of shells.
    """

    field: IndexField
    number: int
    layers: int

    @property
    def index_range(self) -> tuple[float, float]:
        """n - 1 of the ambient and the hottest air, which give all fields the same levels."""
        return self.field.ambient_refractivity, self.field.hottest_refractivity


def references_of(finest: Finest, view: View) -> Callable[[Mode, str], Hits | None]:
    """From a mode and ``SAME_MODE`` or ``"continuous"`` to the reference's hits."""
    continuous: list[Hits] = []

    def reference(mode: Mode, name: str) -> Hits | None:
        if name == SAME_MODE:
            stack = shells_of(
                finest.field,
                finest.layers,
                mode,
                number=finest.number,
                index_range=finest.index_range,
            )
            return None if stack is None else picture_of_shells(view, stack, mode)
        if not continuous:
            continuous.append(picture_of_field(view, finest.field))
        return continuous[0]

    return reference


def check_references(names: tuple[str, ...]) -> None:
    """Raise InputError for a name that is no reference."""
    for name in names:
        if name not in (SAME_MODE, CONTINUOUS):
            raise InputError(
                f'"{name}" is no reference; give "{SAME_MODE}" (shells of the finest field) or '
                f'"{CONTINUOUS}" (the continuous engine on the finest field).'
            )

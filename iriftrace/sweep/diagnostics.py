"""Poses of a sweep that see next to nothing, and why."""

from __future__ import annotations

import os
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.core.arrays import IntArray
from iriftrace.core.errors import IriftraceWarning
from iriftrace.image.metrics import FEWEST_RAYS

if TYPE_CHECKING:
    import xarray as xr


def warn_of_empty_poses(dataset: xr.Dataset) -> None:
    """Say why, when more than half of the poses are empty.

    Warns
    -----
    IriftraceWarning
    """
    good = dataset["rays_good"].sel(region="part").values
    empty: NDArray[np.bool_] = good < FEWEST_RAYS
    if 2 * empty.sum() <= len(empty):
        return
    hits = dataset["rays_hit"].sel(region="part").values
    reasons = {
        "the camera stands in the hot air or the part, or failed": (good < 0).sum(),
        "the part is out of focus": _most(dataset, "rays_out_of_focus", empty),
        "the part is hidden by another object": _most(dataset, "rays_blocked", empty),
        "the part is out of the picture": (empty & (hits == 0)).sum(),
        f"the part covers fewer than {FEWEST_RAYS} pixels": (
            empty & (hits > 0) & (hits < FEWEST_RAYS)
        ).sum(),
    }
    reason = max(reasons, key=lambda text: reasons[text])
    warnings.warn(
        f"{empty.sum()} of {len(empty)} poses see fewer than {FEWEST_RAYS} good rays, mostly "
        f"because {reason}; change the orbit, the focus interval, the focal length or the number "
        "of pixels.",
        IriftraceWarning,
        stacklevel=4,
    )


def _most(dataset: xr.Dataset, name: str, empty: NDArray[np.bool_]) -> int:
    counts = dataset[name].sel(region="part").values
    return int((empty & (counts >= FEWEST_RAYS)).sum())


# MERGE sweep_varied: What a sweep varied besides the pose: field, focal length, distance.

_LENGTHS = (("focal_length", "focal length", "focal"), ("stand_off", "stand-off", "off"))


@frozen
class Varied:
    """Something that has more than one value in a sweep of n poses.

    Attributes
    ----------
    name, short_name : str
        With the unit; the short one fits into a terminal.
    values : (n,) tuple of str
    """

    name: str
    short_name: str
    values: tuple[str, ...]


def varied_of(dataset: xr.Dataset) -> tuple[Varied, ...]:
    """Scene, focal length and stand-off, as far as they differ between the poses of a sweep."""
    found = []
    if "scene" in dataset:
        scenes = [str(name) for name in dataset["scene"].values]
        if len(set(scenes)) > 1:
            found.append(Varied("scene", "scene", tuple(_told_apart(scenes))))
    for variable, name, short_name in _LENGTHS:
        if variable not in dataset:
            continue
        values = tuple(f"{value:g}" for value in dataset[variable].values.tolist())
        if len(set(values)) > 1:
            found.append(Varied(f"{name} (mm)", f"{short_name} mm", values))
    return tuple(found)


def series_of(varied: tuple[Varied, ...], poses: int) -> dict[str, IntArray]:
    """Poses that differ in nothing but position: a description (may be empty) and their numbers."""
    texts = [setting_of(varied, pose) for pose in range(poses)]
    numbers: dict[str, list[int]] = {}
    for pose, text in enumerate(texts):
        numbers.setdefault(text, []).append(pose)
    return {text: np.array(members, dtype=np.int64) for text, members in numbers.items()}


def setting_of(varied: tuple[Varied, ...], pose: int) -> str:
    """What a pose has and others have not, such as "focal length 8 mm"; empty if nothing."""
    return ", ".join(_value(one.name, one.values[pose]) for one in varied)


def _value(name: str, value: str) -> str:
    quantity, _, unit = name.partition(" (")
    return f"{quantity} {value}{' ' + unit.rstrip(')') if unit else ''}"


def _told_apart(names: list[str]) -> list[str]:
    """Paths without what all have in common at the beginning and the end."""
    folders = {name: Path(name).parent for name in names}
    if len({Path(name).name for name in names}) == 1 and len(set(folders.values())) > 1:
        common = os.path.commonpath([folder.absolute() for folder in folders.values()])
        return [os.path.relpath(folders[name].absolute(), common) for name in names]
    return [f"{folders[name].name}/{Path(name).name}" for name in names]

"""Settings of a sweep that differ between its poses: field, focal length, distance."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import IntArray

if TYPE_CHECKING:
    import xarray as xr

_NUMBERS = (
    ("focal_length", "focal length", "focal", "mm"),
    ("stand_off", "stand-off", "off", "mm"),
    ("table", "table's angle", "table", "deg"),
)


@frozen
class Varied:
    """A quantity with more than one value in a sweep; the short label fits into a terminal."""

    quantity: str
    short: str
    unit: str  # "" without a unit
    values: tuple[str, ...]

    @property
    def name(self) -> str:
        """With the unit."""
        return f"{self.quantity} ({self.unit})" if self.unit else self.quantity

    @property
    def short_name(self) -> str:
        """With the unit."""
        return f"{self.short} {self.unit}".strip()

    def text(self, pose: int) -> str:
        """Such as "focal length 8 mm"."""
        return f"{self.quantity} {self.values[pose]} {self.unit}".strip()


def varied_of(dataset: xr.Dataset) -> tuple[Varied, ...]:
    """Scene, focal length, stand-off and table's angle, if they differ between a sweep's poses."""
    found = []
    scenes = [str(name) for name in dataset["scene"].values]
    if len(set(scenes)) > 1:
        found.append(Varied("scene", "scene", "", tuple(_told_apart(scenes))))
    for variable, name, short_name, unit in _NUMBERS:
        if variable in dataset.coords:
            values = tuple(f"{value:g}" for value in dataset[variable].values.tolist())
            if len(set(values)) > 1:
                found.append(Varied(name, short_name, unit, values))
    return tuple(found)


def series_of(varied: tuple[Varied, ...], poses: int) -> dict[str, IntArray]:
    """Poses that differ only in position: a description (may be empty) and their numbers."""
    numbers: dict[str, list[int]] = {}
    settings = tuple(one for one in varied if one.short != "table")
    for pose in range(poses):
        numbers.setdefault(setting_of(settings, pose), []).append(pose)
    return {text: np.array(members, dtype=np.int64) for text, members in numbers.items()}


def setting_of(varied: tuple[Varied, ...], pose: int) -> str:
    """Settings of a pose that differ between poses, such as "focal length 8 mm"; may be empty."""
    return ", ".join(one.text(pose) for one in varied)


def _told_apart(names: list[str]) -> list[str]:
    """Paths without their common beginning and end."""
    folders = {name: Path(name).parent for name in names}
    one_name = len({Path(name).name for name in names}) == 1
    drives = {folder.absolute().drive for folder in folders.values()}  # of Windows
    if one_name and len(drives) == 1 and len(set(folders.values())) > 1:
        common = os.path.commonpath([folder.absolute() for folder in folders.values()])
        return [os.path.relpath(folders[name].absolute(), common) for name in names]
    return [Path(folders[name].name, Path(name).name).as_posix() for name in names]

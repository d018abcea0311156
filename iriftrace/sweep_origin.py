"""What a sweep's attributes say of the files it was made from."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from iriftrace.checksum import sha256_of
from iriftrace.errors import InputError

if TYPE_CHECKING:
    import xarray as xr


def scene_of(dataset: xr.Dataset) -> tuple[Path | None, str]:
    """File of the scene that was swept and its SHA-256, as the attributes say."""
    scene = attribute(dataset, "scene")
    return (Path(scene["path"]), str(scene.get("sha256"))) if "path" in scene else (None, "")


def scene_of_pose(dataset: xr.Dataset, pose: int) -> dict[str, Any]:
    """What the attributes say of the scene of one pose: path, SHA-256, parameters; empty if not."""
    try:
        scenes = json.loads(dataset.attrs.get("scenes", "[]"))
        name = str(dataset["scene"].values[pose])
    except (TypeError, ValueError, KeyError):
        return attribute(dataset, "scene")
    return next((s for s in scenes if s.get("scene") == name), attribute(dataset, "scene"))


def check_unchanged(path: str | Path, sha256: str) -> None:
    """Refuse a file that is not what was swept.

    Raises
    ------
    InputError
        Half a sentence, to go on with.
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"{file} is gone")
    if sha256_of(file) != sha256:
        raise InputError(f"{file} has changed since the sweep")


def attribute(dataset: xr.Dataset, name: str) -> dict[str, Any]:
    """A compound attribute of a sweep; empty if it is missing or something else."""
    try:
        value = json.loads(dataset.attrs.get(name, ""))
    except (TypeError, ValueError):
        return {}
    return value if isinstance(value, dict) else {}

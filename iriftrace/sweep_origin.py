"""What a sweep's attributes say of the files it was made from."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr


def scene_of(dataset: xr.Dataset) -> tuple[Path | None, str]:
    """File of the scene that was swept and its SHA-256, as the attributes say."""
    scene = attribute(dataset, "scene")
    return (Path(scene["path"]), str(scene.get("sha256"))) if "path" in scene else (None, "")


def attribute(dataset: xr.Dataset, name: str) -> dict[str, Any]:
    """A compound attribute of a sweep; empty if it is missing or something else."""
    try:
        value = json.loads(dataset.attrs.get(name, ""))
    except (TypeError, ValueError):
        return {}
    return value if isinstance(value, dict) else {}

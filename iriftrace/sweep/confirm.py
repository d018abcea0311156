"""Poses of a sweep traced once more, through the field itself and not through its shells."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.core.arrays import BoolArray
from iriftrace.core.errors import InputError
from iriftrace.scene.air import IN_LAYERS
from iriftrace.sweep.measures import MEASURES, RAYS
from iriftrace.sweep.reload import SweptScene, load_swept_scene
from iriftrace.sweep.store import WHOLE_PART, scene_of_pose
from iriftrace.sweep.warned import VARIABLE, warned_variable

if TYPE_CHECKING:
    import xarray as xr


def traced_through_field(dataset: xr.Dataset) -> BoolArray:
    """Mask (n,) of the poses whose numbers come from the continuous engine."""
    count = dataset.sizes["pose"]
    names = dataset["scene"].values.astype(str) if "scene" in dataset else np.zeros(count)
    _, first, scene = np.unique(names, return_index=True, return_inverse=True)
    engines = [scene_of_pose(dataset, int(pose)).get("engine") for pose in first]
    found: BoolArray = np.array([engine == "continuous" for engine in engines])[scene]
    return found | (dataset["through_field"].values == 1) if "through_field" in dataset else found


def field_tracer(dataset: xr.Dataset) -> Callable[[xr.Dataset, int], xr.Dataset]:
    """What traces poses of a sweep through the field; loads each scene when it is first needed.

    Called with the sweep and a pose's number, it gives the sweep with that pose's numbers anew. It
    replaces the metrics of the part and its regions, and the rays' ends; what the pose sees of
    each face stays what the sweep saw. It raises as `scene_with_field`.
    """
    scenes: dict[tuple[str, float], SweptScene] = {}

    def trace(known: xr.Dataset, pose: int) -> xr.Dataset:
        lens = float(known["focal_length"].values[pose]) if "focal_length" in known else np.nan
        key = str(scene_of_pose(known, pose).get("path")), lens
        if key not in scenes:
            scenes[key] = scene_with_field(known, pose)
        return _with_pose(known, pose, scenes[key])

    return trace


def scene_with_field(dataset: xr.Dataset, pose: int) -> SweptScene:
    """Load the scene of a pose to be traced through its field itself.

    InputError, half a sentence, if the scene is gone, has changed, has no field or several, or
    bends rays at the shells alone; SetupError if it cannot be traced here.
    """
    bending = dataset.attrs.get("bending", IN_LAYERS)
    if bending != IN_LAYERS:
        raise InputError(f"the sweep bends rays {bending}")
    named = scene_of_pose(dataset, pose)
    if "members" in named:
        raise InputError("the scene has several fields")
    swept = load_swept_scene(dataset, pose, engine="continuous")
    source = swept.scene.shells_table.get("source") or {}
    if source.get("sha256") != (named.get("field") or {}).get("sha256"):
        raise InputError(
            f"the field beside {swept.scene.path} is not what its shells were cut from"
        )
    return swept


def _with_pose(dataset: xr.Dataset, pose: int, swept: SweptScene) -> xr.Dataset:
    nearest = bool(np.isfinite(dataset["axial_resolution_nn3d"].values).any())
    rendering = swept.render(dataset["matrix"].values[pose], nearest=nearest)
    whole = rendering.metrics.as_dict()
    views = [
        whole if name == WHOLE_PART else whole["regions"].get(name)
        for name in map(str, dataset["region"].values)
    ]
    found = dataset.copy()
    for name, one in {**MEASURES, **RAYS}.items():
        values = dataset[name].values.copy()
        values[pose] = [one.value(view) for view in views] if one.regional else one.value(whole)
        found[name] = dataset[name].copy(data=values)
    through = np.array(dataset["through_field"].values, dtype=np.float64)
    through[pose] = 1.0
    found["through_field"] = dataset["through_field"].copy(data=through)
    return found.assign({VARIABLE: warned_variable(found)})

"""What a sweep goes through: poses of one scene with one camera, and several such series."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from attrs import frozen

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose_set import PoseSet
from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of
from iriftrace.scene.load import LoadedScene
from iriftrace.sweep.pose import PoseResult, PoseTask, SceneSource, render_pose, source_of

RenderPoses = Callable[[Iterable[PoseTask]], Iterator[PoseResult]]
"""Who renders: takes the tasks of a sweep and gives the results in any order."""


@frozen(eq=False)
class Series:
    """Poses of one scene with one camera.

    Attributes
    ----------
    scene : LoadedScene
    camera : Camera
        Intrinsics and focus interval; its pose is not used.
    poses : PoseSet
    stand_off_mm : float, mm
        What the orbit's semi-axes exceed the part's half extents by; NaN for other poses.
    """

    scene: LoadedScene
    camera: Camera
    poses: PoseSet
    stand_off_mm: float = math.nan


def check_comparable(series: Sequence[Series]) -> None:
    """Refuse series whose poses could not be ranked together.

    Raises
    ------
    InputError
        If there is no pose, a camera is orthographic, or the scenes have different parts, variants,
        wavelengths or cameras; only focal length and pose of the camera may differ.
    """
    if sum(len(one.poses) for one in series) == 0:
        raise InputError("The sweep has no pose; give angles or a list of poses.")
    first = series[0]
    first.camera.check_movable()
    for one in series[1:]:
        names = f"{first.scene.path} and {one.scene.path}"
        same_place = np.array_equal(one.scene.part_to_world, first.scene.part_to_world)
        if one.scene.part.sha256 != first.scene.part.sha256 or not same_place:
            raise InputError(
                f"{names} have different parts ({first.scene.part.path}, {one.scene.part.path}) or "
                "place them differently, so that faces and poses could not be compared; sweep them "
                "one by one."
            )
        if one.scene.variant != first.scene.variant:
            raise InputError(
                f"{names} were loaded with different variants; load both with the same."
            )
        light = [s.scene.wavelength_nm for s in (first, one)]
        if None not in light and light[0] != light[1]:
            raise InputError(
                f"{names} were made for light of {light[0]:g} and {light[1]:g} nm, which hot air "
                "bends differently; give both the same with --wavelength."
            )
        if _sensor(one.camera) != _sensor(first.camera):
            raise InputError(
                f"{names} have cameras that differ in more than pose and focal length, so that "
                "their poses could not be compared; give both the same sensor."
            )


def _sensor(camera: Camera) -> dict[str, Any]:
    varied = ("matrix", "focal_length_mm")
    return {key: value for key, value in camera.as_dict().items() if key not in varied}


def sources_of(series: Sequence[Series]) -> list[SceneSource]:
    """Where the scene of each series lies; each scene is read once."""
    known: dict[int, SceneSource] = {}
    for one in series:
        scene = one.scene
        if id(scene) not in known:
            known[id(scene)] = source_of(scene.path, scene.variables, scene.variant, scene.engine)
    return [known[id(one.scene)] for one in series]


def render_here(series: Sequence[Series], sources: Sequence[SceneSource]) -> RenderPoses:
    """Render in this process, one pose after the other."""
    scenes = {source.fingerprint: one.scene for source, one in zip(sources, series, strict=True)}

    def render(tasks: Iterable[PoseTask]) -> Iterator[PoseResult]:
        for task in tasks:
            yield render_pose(task, scenes[task.source.fingerprint])

    return render


def series_variables(series: Sequence[Series]) -> dict[str, Any]:
    """Scene, focal length and stand-off of each pose, as variables of a dataset."""
    counts = [len(one.poses) for one in series]
    scenes = np.array([str(one.scene.path) for one in series], dtype=object)
    focal = [one.camera.focal_length_mm for one in series]
    stand_off = [one.stand_off_mm for one in series]
    millimetres = {"units": "mm"}
    return {
        "scene": (("pose",), np.repeat(scenes, counts), {"long_name": "file of the scene"}),
        "focal_length": (("pose",), np.repeat(np.array(focal), counts), millimetres),
        "stand_off": (
            ("pose",),
            np.repeat(np.array(stand_off), counts),
            {**millimetres, "long_name": "semi-axes of the orbit less half extents of the part"},
        ),
    }


def scenes_attribute(
    series: Sequence[Series], sources: Sequence[SceneSource]
) -> list[dict[str, Any]]:
    """Every scene once: path as given, absolute path, SHA-256, files, parameters and field."""
    scenes = {str(one.scene.path): one.scene for one in series}
    files = {str(one.scene.path): source.files for one, source in zip(series, sources, strict=True)}
    return [
        {
            "scene": name,
            "path": str(Path(name).resolve()),
            "sha256": sha256_of(scene.path),
            "files": files[name],
            "variables": scene.variables,
            "variant": scene.variant,
            "engine": scene.engine,
            "field": scene.shells_table.get("source"),
            **(
                {}
                if scene.ensemble is None
                else {"members": [member.as_dict() for member in scene.ensemble.members]}
            ),
        }
        for name, scene in scenes.items()
    ]

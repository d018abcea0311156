"""Series of a sweep: poses of one scene with one camera, and whether several can be compared."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

import numpy as np
from attrs import evolve, frozen

from iriftrace.camera.camera import Camera
from iriftrace.camera.pose_set import PoseSet, offset_outward
from iriftrace.core.arrays import Variables
from iriftrace.core.errors import InputError, warn
from iriftrace.core.plain import JsonObject, plain
from iriftrace.sweep.journal import Piece
from iriftrace.sweep.pose import PoseTask, SceneSource, source_of
from iriftrace.sweep.rig import Rig, rig_of
from iriftrace.tracing.rays import is_inside
from iriftrace.tracing.scene import Scene

RenderPoses = Callable[[Iterable[PoseTask]], Iterator[Piece]]
"""Renders the tasks of a sweep and yields the results in any order."""


@frozen(eq=False)
class Series:
    """Poses of one scene with one camera, whose own pose is not used.

    The stand-off is the excess of the orbit's semi-axes over the part's half extents; NaN for other
    poses. A second device moves with the camera.
    """

    scene: Scene
    camera: Camera
    poses: PoseSet
    stand_off_mm: float = math.nan
    rig: Rig | None = None


def all_series(
    scenes: Sequence[Scene],
    poses: PoseSet | Mapping[float, PoseSet],
    focal_lengths_mm: Sequence[float] = (),
    *,
    move_out: bool = False,
) -> list[Series]:
    """Every combination of scene, focal length and set of poses; see `run_sweep`.

    Raises InputError if the camera has no focal length to change, or if cameras that are moved out
    of the air, or all of them, stand in the part.
    """
    sets = {math.nan: poses} if isinstance(poses, PoseSet) else poses
    series: list[Series] = []
    for scene in scenes:
        placed = {key: _placed(scene, one, move_out) for key, one in sets.items()}
        series += [
            Series(scene, camera, one, stand_off, rig_of(scene))
            for camera in _cameras(scene.camera, focal_lengths_mm)
            for stand_off, one in placed.items()
        ]
    return series


def _cameras(camera: Camera, focal_lengths_mm: Sequence[float]) -> list[Camera]:
    if not focal_lengths_mm:
        return [camera]
    lengths = ", ".join(f"{length:g}" for length in focal_lengths_mm)
    if camera.projection != "pinhole":
        raise InputError(
            f"The focal length is to be {lengths} mm, but the scene's camera is "
            f"{camera.projection} and has none; leave it out.",
            code="camera.no_focal_length",
            argument="focal_length",
        )
    if camera.distortion is not None:
        raise InputError(
            f"The focal length is to be {lengths} mm, but the scene's lens distortion was "
            f"calibrated at {camera.focal_length_mm:g} mm and differs at other lengths; leave "
            "it out, or the distortion.",
            code="camera.calibrated_length",
            argument="focal_length",
        )
    return [evolve(camera, focal_length_mm=length) for length in focal_lengths_mm]


def _placed(scene: Scene, poses: PoseSet, move_out: bool) -> PoseSet:
    part = scene.part
    inside = part.closed and part.surface.inside(poses.origins)
    count = int(np.sum(inside))
    if move_out and count:
        raise InputError(
            f"{count} of {len(poses)} poses of the orbit stand inside the part, where there is "
            "nothing to see; give larger semi-axes.",
            code="poses.inside_part",
            argument="semi_axes",
        )
    if 0 < count == len(poses):
        raise InputError(
            "No pose stands outside the part, so there is nothing to see; check their positions, "
            "and their unit.",
            code="poses.inside_part",
            argument="length_unit",
        )
    if not move_out:
        return poses
    free, moved = offset_outward(poses, lambda points: is_inside(scene, points))
    if moved.any():
        warn(
            f"{moved.sum()} of {len(poses)} poses stood in the hot air and were moved back along "
            "their line of sight."
        )
    return free


def check_comparable(series: Sequence[Series], *, of_files: bool) -> None:
    """Raise InputError if the poses of the series could not be ranked together.

    They have no pose, a scene in memory although files are needed, an orthographic camera, or
    different parts, variants, wavelengths or cameras; only focal length and pose of the camera may
    differ.
    """
    if sum(len(one.poses) for one in series) == 0:
        raise InputError(
            "The sweep has no pose; give angles or a list of poses.", code="sweep.no_pose"
        )
    first = series[0]
    first.camera.check_movable()
    for one in series[1:]:
        names = f"{first.scene.name} and {one.scene.name}"
        same_place = np.array_equal(one.scene.part_to_world, first.scene.part_to_world)
        if one.scene.part.sha256 != first.scene.part.sha256 or not same_place:
            raise InputError(
                f"{names} have different parts ({first.scene.part.path}, {one.scene.part.path}) or "
                "place them differently, so that faces and poses could not be compared; sweep them "
                "one by one.",
                code="sweep.different_parts",
            )
        if one.scene.compiled.variant != first.scene.compiled.variant:
            raise InputError(
                f"{names} were loaded with different variants; load both with the same.",
                code="sweep.different_variants",
            )
        light = [s.scene.compiled.stated.wavelength_nm for s in (first, one)]
        if None not in light and light[0] != light[1]:
            raise InputError(
                f"{names} were made for light of {light[0]:g} and {light[1]:g} nm, which hot air "
                "bends differently; give both the same.",
                code="sweep.different_wavelengths",
                argument="wavelength",
            )
        alone = first.rig is None and one.rig is None
        if not alone and not (first.rig and first.rig.same_as(one.rig)):
            raise InputError(
                f"{names} have different second devices, or one has none, so that what they "
                "measure could not be compared; give both the same.",
                code="sweep.different_devices",
            )
        if _sensor(one.camera) != _sensor(first.camera):
            raise InputError(
                f"{names} have cameras that differ in more than pose and focal length, so that "
                "their poses could not be compared; give both the same sensor.",
                code="sweep.different_cameras",
            )
    if of_files and any(one.scene.path is None for one in series):
        raise InputError(
            "A sweep with a file can continue after a break, and workers read scenes themselves, "
            "so both need the files of the scenes; write the scene first (Scene.save) and sweep "
            "that, or leave the sweep's file and the workers out.",
            code="sweep.no_files",
        )


def _sensor(camera: Camera) -> JsonObject:
    varied = ("matrix", "focal_length_mm")
    return {key: value for key, value in camera.as_dict().items() if key not in varied}


def sources_of(series: Sequence[Series]) -> list[SceneSource | None]:
    """Source of each series' scene, None for one in memory; each scene is read once."""
    scenes = {id(one.scene): one.scene for one in series}
    known = {
        key: None
        if scene.path is None
        else source_of(scene.path, scene.variables, scene.compiled.variant, scene.engine)
        for key, scene in scenes.items()
    }
    return [known[id(one.scene)] for one in series]


def series_variables(series: Sequence[Series]) -> Variables:
    """Scene, focal length and stand-off of each pose, as variables of a dataset."""
    counts = [len(one.poses) for one in series]
    scenes = np.array(_names(series), dtype=object)
    focal = np.array([one.camera.focal_length_mm for one in series])
    stand_off = np.array([one.stand_off_mm for one in series])
    excess = {"units": "mm", "long_name": "semi-axes of the orbit less half extents of the part"}
    return {
        "scene": (
            ("pose",),
            np.repeat(scenes, counts),
            {"long_name": "file of the scene, or its name"},
        ),
        "focal_length": (("pose",), np.repeat(focal, counts), {"units": "mm"}),
        "stand_off": (("pose",), np.repeat(stand_off, counts), excess),
    }


def _names(series: Sequence[Series]) -> list[str]:
    """Name of each series' scene; others of the same name are numbered, as in "the scene 2"."""
    names: dict[int, str] = {}
    for one in series:
        given, number = one.scene.name, 1
        name = given
        while id(one.scene) not in names and name in names.values():
            number += 1
            name = f"{given} {number}"
        names.setdefault(id(one.scene), name)
    return [names[id(one.scene)] for one in series]


def scenes_attribute(
    series: Sequence[Series], sources: Sequence[SceneSource | None]
) -> list[JsonObject]:
    """Each scene once: path as given, absolute path, SHA-256, files, parameters and field.

    A scene in memory has neither paths nor files.
    """
    scenes: dict[str, JsonObject] = {}
    for one, source, name in zip(series, sources, _names(series), strict=True):
        scene = one.scene
        files = {}
        if scene.path is not None and source is not None:
            files = {"path": source.path, "sha256": scene.sha256, "files": source.files}
        scenes[name] = {
            "scene": name,
            **files,
            "variables": scene.variables,
            "variant": scene.compiled.variant,
            "engine": scene.compiled.engine.value,
            "requested_engine": scene.engine.value,
            "field": plain(scene.compiled.source),
        }
        if scene.members:
            scenes[name]["members"] = [member.as_dict() for member in scene.members]
    return list(scenes.values())

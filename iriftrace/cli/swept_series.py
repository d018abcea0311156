"""What ``iriftrace sweep`` renders: scenes, cameras, and poses where a camera can stand."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from iriftrace.cli.console import notes
from iriftrace.cli.orbit_options import OrbitOptions, different_lengths
from iriftrace.cli.trace_options import TraceOptions
from iriftrace.errors import InputError

if TYPE_CHECKING:
    from iriftrace.camera import Camera
    from iriftrace.pose_set import PoseSet
    from iriftrace.scene import LoadedScene
    from iriftrace.sweep_series import Series


def series_of(
    paths: list[Path],
    orbit: OrbitOptions,
    focal_length: str | None,
    trace: TraceOptions,
) -> list[Series]:
    """Every combination of scene, focal length and orbit; scene by scene.

    Raises
    ------
    InputError
        Scenes cannot be compared, the camera has no focal length to change, or poses stand in the
        part.
    """
    from iriftrace.sweep_series import Series, check_comparable

    series = []
    for path in paths:
        with notes.status("Loading the scene ..."):
            scene = trace.load(path)
        cameras = _cameras(scene.camera, focal_length)
        orbits = [
            (stand_off, _placed(scene, poses, listed=orbit.poses))
            for stand_off, poses in orbit.pose_sets(scene, scene.camera)
        ]
        series += [
            Series(scene, camera, poses, stand_off)
            for camera in cameras
            for stand_off, poses in orbits
        ]
        check_comparable(series)
    return series


def _cameras(camera: Camera, focal_length: str | None) -> list[Camera]:
    from attrs import evolve

    if focal_length is None:
        return [camera]
    if camera.projection != "pinhole":
        raise InputError(
            f"--focal-length is {focal_length}, but the scene's camera is {camera.projection} and "
            "has none; leave it out."
        )
    if camera.distortion is not None:
        raise InputError(
            f"--focal-length is {focal_length}, but the scene's lens distortion was calibrated at "
            f"{camera.focal_length_mm:g} mm and is another at other lengths; leave one of them out."
        )
    lengths = different_lengths(focal_length, "--focal-length")
    return [evolve(camera, focal_length_mm=length) for length in lengths]


def _placed(scene: LoadedScene, poses: PoseSet, *, listed: Path | None) -> PoseSet:
    """Poses where cameras can stand: an orbit's out of the hot air, a list's as they are."""
    from iriftrace.enclosure import inside_closed

    part = scene.part
    inside = part.closed and inside_closed(poses.origins, part.vertices, part.faces)
    # A list may name some by mistake, which fail without stopping the rest.
    if listed is not None and np.all(inside):
        raise InputError(
            f"All {len(poses)} poses of {listed} stand inside the part, where there is nothing to "
            "see; check its positions, and its unit with --length-unit."
        )
    if listed is None and np.any(inside):
        raise InputError(
            f"{np.sum(inside)} of {len(poses)} poses of the orbit stand inside the part, where "
            "there is nothing to see; give larger semi-axes."
        )
    return poses if listed is not None else _outside(scene, poses)


def _outside(scene: LoadedScene, poses: PoseSet) -> PoseSet:
    """Poses inside the hot air moved back out of it, which is reported."""
    from iriftrace.pose_set import push_out
    from iriftrace.render import is_inside

    with notes.status("Looking where the cameras stand ..."):
        free, moved = push_out(poses, lambda points: is_inside(scene, points))
    if moved.any():
        notes.print(
            f"[bold yellow]warning:[/] {moved.sum()} of {len(poses)} poses stood in the hot air "
            "and were moved back along their line of sight.",
            soft_wrap=True,
        )
    return free

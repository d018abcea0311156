"""Options with which the poses of a file would look at the part, where they look elsewhere."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from iriftrace.camera.pose_files import CONVENTIONS, from_convention, read_poses, to_convention
from iriftrace.camera.pose_set import PoseSet
from iriftrace.camera.robot_poses import ROBOTS, RobotName
from iriftrace.cli.camera_options import FEWEST_PIXELS
from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError, warn, without_warnings

if TYPE_CHECKING:
    from iriftrace.scene.loaded import LoadedScene

_OPTIONS = ("--convention", "--length-unit", "--robot")
_INVERSE = "the inverse matrices (from the camera to the world)"
_UNITS = ("mm", "m", "cm", "um", "inch")

Frames = dict[str, Any]
"""Motions (4, 4) by their names in `read_poses`: ``hand_eye`` and ``base_to_part``."""


def aimed_poses(
    file: Path,
    scene: LoadedScene,
    convention: str,
    length_unit: str,
    robot: RobotName | None,
    frames: Frames,
) -> PoseSet:
    """Poses of a file (`read_poses`), with the `frames` of a robot, that look at the part in focus.

    Raises InputError where none does, but all would with other options; warns of fewer than half.
    Where none of the options has the part in focus, poses that look at it are enough.
    """
    poses = read_poses(file, convention, length_unit=length_unit, robot=robot, **frames)
    for focus in (scene.camera.focus_mm, (0.0, math.inf)):
        seeing = int(_look_at_part(poses, scene, focus).sum())
        if 2 * seeing >= len(poses):
            return poses
        with without_warnings():
            others = _read_otherwise(file, convention, length_unit, robot, frames)
            found = (each for each in others if _look_at_part(each[1], scene, focus).all())
            remedy, read = next(found, ("", poses))
        if remedy:
            break
    else:
        return poses
    now, then = (np.median(distances(each, scene)) for each in (poses, read))
    text = (
        f"look at the part, but all would with {remedy}. Their distance from its middle (median) "
        f"is {now:.3g} mm as they are read and {then:.3g} mm then; the focus is "
        f"{' to '.join(f'{end:g}' for end in scene.camera.focus_mm)} mm."
    )
    if not seeing:
        raise InputError(f"The poses in {file} do not {text}")
    warn(f"Only {seeing} of the {len(poses)} poses in {file} {text}")
    return poses


def distances(poses: PoseSet, scene: LoadedScene) -> FloatArray:
    """(n,) distances of the cameras from the middle of the part, mm."""
    return np.asarray(np.linalg.norm(scene.part.centre - poses.origins, axis=1))


def _look_at_part(poses: PoseSet, scene: LoadedScene, focus_mm: tuple[float, float]) -> BoolArray:
    """(n,) mask of poses outside the part's box, that see a sphere around it, partly in focus."""
    camera, (low, high) = scene.camera, scene.part.bounds
    if camera.projection == "orthographic":
        return np.ones(len(poses), dtype=bool)
    offset, radius = scene.part.centre - poses.origins, 0.5 * np.linalg.norm(high - low)
    outside = ((poses.origins < low) | (poses.origins > high)).any(axis=1)
    distance = np.maximum(distances(poses, scene), 1e-9)
    axial = np.sum(poses.forward * offset, axis=1) / distance
    half = np.arctan(0.5 * np.hypot(*camera.sensor_mm) / camera.focal_length_mm)
    beside = np.arccos(np.clip(axial, -1.0, 1.0)) - half
    large = 2.0 * radius * camera.focal_px[0] > FEWEST_PIXELS * distance
    in_focus = (distance > focus_mm[0]) & (distance - radius < focus_mm[1])
    seen = beside < np.arcsin(np.minimum(radius / distance, 1.0))
    return np.asarray(outside & large & in_focus & seen)


def _read_otherwise(
    file: Path, convention: str, length_unit: str, robot: RobotName | None, frames: Frames
) -> Iterator[tuple[str, PoseSet]]:
    """What else the options may be, those with the fewest changes first, and the poses then."""
    alike: list[RobotName | None] = [None]
    if robot is not None:
        alike = [name for name in ROBOTS if ROBOTS[name].columns == ROBOTS[robot].columns]
    others = _other_frames(frames) if frames else {_INVERSE: frames}
    given = (convention, length_unit, robot, "")

    def changes(choice: tuple[str, str, RobotName | None, str]) -> int:
        return sum(one != other for one, other in zip(choice, given, strict=True))

    for choice in sorted(product(CONVENTIONS, _UNITS, alike, ("", *others)), key=changes):
        axes, unit, maker, motion = choice
        values = zip(_OPTIONS, choice[:3], given[:3], strict=True)
        options = [f"{name} {value}" for name, value, old in values if value != old]
        used = others.get(motion, frames)
        try:
            poses = read_poses(file, axes, length_unit=unit, robot=maker, **used)
        except InputError:  # such as a file that states its convention
            continue
        if motion == _INVERSE:
            turned = np.linalg.inv(to_convention(poses.matrices, axes))
            poses = PoseSet(from_convention(turned, axes))
        yield " and ".join(filter(None, (*options, motion))), poses


def _other_frames(frames: Frames) -> dict[str, Frames]:
    """Motions of a robot's flange and base that were meant the other way round or are in m."""
    found = {}
    for name, matrix in frames.items():
        option = f"--{name.replace('_', '-')}"
        metres = matrix.copy()
        metres[:3, 3] *= 1e3
        found[f"the inverse of {option}"] = {**frames, name: np.linalg.inv(matrix)}
        found[f"the translation in {option} in m (write it in mm)"] = {**frames, name: metres}
    return found

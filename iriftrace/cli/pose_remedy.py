"""Options with which the poses of a file would look at the part, where they look elsewhere."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from iriftrace.camera.pose_files import CONVENTIONS, from_convention, read_poses, to_convention
from iriftrace.camera.pose_set import PoseSet
from iriftrace.camera.robot_poses import ROBOTS, RobotName
from iriftrace.cli.camera_options import FEWEST_PIXELS
from iriftrace.core.arrays import BoolArray
from iriftrace.core.errors import InputError, warn, without_warnings

if TYPE_CHECKING:
    from iriftrace.scene.loaded import LoadedScene

_OPTIONS = ("--convention", "--length-unit", "--robot")
_UNITS = ("mm", "m", "cm", "um", "inch")


def aimed_poses(
    file: Path,
    scene: LoadedScene,
    convention: str,
    length_unit: str,
    robot: RobotName | None,
    frames: dict[str, Any],
) -> PoseSet:
    """Poses of a file (`read_poses`), with the `frames` of a robot, that look at the part.

    Raises InputError where none does, but all would with other options; warns of fewer than half.
    """
    poses = read_poses(file, convention, length_unit=length_unit, robot=robot, **frames)
    seeing = int(_look_at_part(poses, scene).sum())
    if 2 * seeing >= len(poses):
        return poses
    with without_warnings():
        others = _read_otherwise(file, convention, length_unit, robot, frames)
        remedy = next((how for how, read in others if _look_at_part(read, scene).all()), "")
    text = f"look at the part, but all would with {remedy}."
    if remedy and not seeing:
        raise InputError(f"The poses in {file} do not {text}")
    if remedy:
        warn(f"Only {seeing} of the {len(poses)} poses in {file} {text}")
    return poses


def _look_at_part(poses: PoseSet, scene: LoadedScene) -> BoolArray:
    """(n,) mask of poses outside the part's box, in whose picture a sphere around it appears."""
    camera, (low, high) = scene.camera, scene.part.bounds
    if camera.projection == "orthographic":
        return np.ones(len(poses), dtype=bool)
    offset, radius = scene.part.centre - poses.origins, 0.5 * np.linalg.norm(high - low)
    outside = ((poses.origins < low) | (poses.origins > high)).any(axis=1)
    distance = np.maximum(np.linalg.norm(offset, axis=1), 1e-9)
    axial = np.sum(poses.forward * offset, axis=1) / distance
    half = np.arctan(0.5 * np.hypot(*camera.sensor_mm) / camera.focal_length_mm)
    beside = np.arccos(np.clip(axial, -1.0, 1.0)) - half
    large = 2.0 * radius * camera.focal_px[0] > FEWEST_PIXELS * distance
    return np.asarray(outside & large & (beside < np.arcsin(np.minimum(radius / distance, 1.0))))


def _read_otherwise(
    file: Path, convention: str, length_unit: str, robot: RobotName | None, frames: dict[str, Any]
) -> Iterator[tuple[str, PoseSet]]:
    """What else the options may be, those with the fewest changes first, and the poses then."""
    alike: list[RobotName | None] = [None]
    if robot is not None:
        alike = [name for name in ROBOTS if ROBOTS[name].columns == ROBOTS[robot].columns]
    # The inverse of a flange's pose is none of a camera.
    ways = ("", "the inverse matrices (from the camera to the world)")[: 1 if frames else 2]
    tried = product(CONVENTIONS, _UNITS, alike, ways)
    given = (convention, length_unit, robot, "")

    def changes(choice: tuple[str, str, RobotName | None, str]) -> int:
        return sum(one != other for one, other in zip(choice, given, strict=True))

    for axes, unit, maker, inverse in sorted(tried, key=changes):
        values = zip(_OPTIONS, (axes, unit, maker), given[:3], strict=True)
        options = [f"{name} {value}" for name, value, old in values if value != old]
        try:
            poses = read_poses(file, axes, length_unit=unit, robot=maker, **frames)
        except InputError:  # such as a file that states its convention
            continue
        if inverse:
            turned = np.linalg.inv(to_convention(poses.matrices, axes))
            poses = PoseSet(from_convention(turned, axes))
        yield " and ".join([*options, *filter(None, (inverse,))]), poses

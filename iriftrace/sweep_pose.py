"""One pose of a sweep: what is asked of whoever renders it, and what comes back."""

from __future__ import annotations

import json
import warnings
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

from attrs import frozen

from iriftrace import runtime
from iriftrace.camera import Camera
from iriftrace.errors import InputError, IriftraceWarning
from iriftrace.face_sightings import NOTHING_SEEN, FaceSightings, sight_faces
from iriftrace.part_file import sha256_of
from iriftrace.render import render_scene
from iriftrace.scene import LoadedScene
from iriftrace.scene_file import read_scene_file

_KEPT = ("rays", "time_s", "shell_triangles_in_view", "regions")


@frozen
class SceneSource:
    """Where a process that renders poses finds their scene.

    Attributes
    ----------
    path : str
        The scene's XML file, absolute.
    variables : dict of str
        Values for its ``<default>`` parameters.
    variant : str
        Mitsuba variant.
    fingerprint : str
        SHA-256 of the file, of those that it names, and of variables and variant.
    version : str
        Of iriftrace.
    files : dict of str
        SHA-256 of each file that the scene names, by absolute path.
    """

    path: str
    variables: dict[str, str]
    variant: str
    fingerprint: str
    version: str
    files: dict[str, str]


@frozen(eq=False)
class PoseTask:
    """A pose to be rendered; small, and understood by every process that sees the scene's files.

    Attributes
    ----------
    number : int
        Of the pose in its sweep.
    source : SceneSource
    camera : Camera
        With its pose.
    include : tuple of int
        Status codes whose rays the metrics use.
    nearest : bool
        See :func:`iriftrace.metrics.pose_metrics`.
    exr : str
        File for the AOV image, absolute; empty for none.
    """

    number: int
    source: SceneSource
    camera: Camera
    include: tuple[int, ...]
    nearest: bool
    exr: str


@frozen(eq=False)
class PoseResult:
    """What one pose gives.

    Attributes
    ----------
    number : int
        Of the pose in its sweep.
    entry : dict
        Plain JSON values: ``metrics`` (None if the pose failed) and ``failure`` (why, else empty).
    sightings : FaceSightings
    """

    number: int
    entry: dict[str, Any]
    sightings: FaceSightings


def source_of(path: Path, variables: dict[str, str], variant: str) -> SceneSource:
    """The scene as it lies on the disk now.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    with runtime.using(variant), warnings.catch_warnings():
        # Said when the scene is loaded.
        warnings.simplefilter("ignore", IriftraceWarning)
        files = read_scene_file(path, variables).file_paths
    contents = {str(file.resolve()): sha256_of(file) for file in files}
    content = [sha256_of(path), *(contents[str(file.resolve())] for file in files)]
    return SceneSource(
        path=str(path.resolve()),
        variables=variables,
        variant=variant,
        fingerprint=fingerprint(content, variables, variant),
        version=version("iriftrace"),
        files=contents,
    )


def fingerprint(*pieces: Any) -> str:
    """SHA-256 of plain values."""
    return sha256(json.dumps(pieces, sort_keys=True).encode()).hexdigest()


def render_pose(task: PoseTask, scene: LoadedScene) -> PoseResult:
    """Render one pose and reduce it; the same in every process.

    Parameters
    ----------
    task : PoseTask
    scene : LoadedScene
        Loaded from the task's source.

    Raises
    ------
    InputError
        If the image cannot be written. A pose without a picture is a result that says why.
    """
    with warnings.catch_warnings():
        # Said once for the sweep, and not for every pose.
        warnings.simplefilter("ignore", IriftraceWarning)
        try:
            rendering = render_scene(
                scene, camera=task.camera, include=task.include, nearest=task.nearest, empty=True
            )
        except InputError as error:
            return PoseResult(task.number, {"metrics": None, "failure": str(error)}, NOTHING_SEEN)
    if task.exr:
        rendering.save(task.exr)
    measured = {
        key: value for key, value in rendering.metrics.items() if key in _KEPT or _is_measure(key)
    }
    return PoseResult(
        task.number,
        {"metrics": measured, "failure": ""},
        sight_faces(rendering.image, task.include),
    )


def _is_measure(key: str) -> bool:
    return key.endswith(("_mm", "_px", "_deg", "_nn3d", "_nnxy")) or key.startswith("coverage")

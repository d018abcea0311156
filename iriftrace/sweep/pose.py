"""One pose of a sweep: the task, the scene that it needs, and its rendering."""

from __future__ import annotations

import json
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from attrs import frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.engines import Engine
from iriftrace.core.errors import InputError, without_warnings
from iriftrace.core.files import sha256_of
from iriftrace.core.runtime import variant as runtime
from iriftrace.image.sightings import sight_faces
from iriftrace.sweep.journal import Piece
from iriftrace.sweep.rig import add_measured
from iriftrace.tracing.load import scene_files
from iriftrace.tracing.render import render_scene
from iriftrace.tracing.scene import Scene

_OF_ALL_POSES = ("schema", "full_camera", "wavelength_nm", "camera", "pose", "assumptions")
"""Keys of a pose's metrics that the sweep states for all poses or for none."""


@frozen
class SceneSource:
    """Where a process that renders poses finds their scene.

    The path is absolute. The fingerprint is the SHA-256 of the file, of files that it names, and
    of variables (of its ``<default>`` parameters), variant and engine. Each file has a SHA-256, by
    absolute path. The engine is the requested one.
    """

    path: str
    variables: dict[str, str]
    variant: str
    fingerprint: str
    version: str
    files: dict[str, str]
    engine: Engine = Engine.AUTO


@frozen(eq=False)
class PoseTask:
    """A pose to render; small, and usable by every process that sees the scene's files.

    `series` is the number of its series, from 0, and `source` that of its scene; None for a scene
    in memory, which this process alone knows. `include` has the status codes of the rays that the
    metrics use; `exr` is the AOV image's absolute path, or empty; `second` is the other device of a
    sensor that measures by triangulation.
    """

    number: int
    series: int
    source: SceneSource | None
    camera: Camera
    include: tuple[int, ...]
    exr: str
    second: Camera | None = None


def source_of(
    path: Path, variables: dict[str, str], variant: str, engine: Engine = Engine.AUTO
) -> SceneSource:
    """The scene in its present state on the disk; raises InputError if it cannot be read."""
    with runtime.using(variant), without_warnings():
        # Warned of when the scene is loaded.
        files = scene_files(path, variables, field=engine.may_use_field)
    contents = {str(file.resolve()): sha256_of(file) for file in files}
    content = [sha256_of(path), *(contents[str(file.resolve())] for file in files)]
    return SceneSource(
        path=str(path.resolve()),
        variables=variables,
        variant=variant,
        fingerprint=fingerprint(content, variables, variant, engine),
        version=version("iriftrace"),
        files=contents,
        engine=engine,
    )


def fingerprint(*pieces: object) -> str:
    """SHA-256 of plain values."""
    return sha256(json.dumps(pieces, sort_keys=True).encode()).hexdigest()


def render_pose(task: PoseTask, scene: Scene) -> Piece:
    """Render one pose of a scene loaded from the task's source; the same in every process.

    The piece's entry has ``metrics`` (None if the pose failed) and ``failure`` (why, else empty);
    its rows are those of `FaceSightings`. Raises InputError if the image cannot be written. A pose
    without a picture is a result that states why.
    """
    with without_warnings():
        # Warned of once for the sweep, and not for every pose.
        try:
            rendering = render_scene(scene, camera=task.camera, include=task.include, empty=True)
        except InputError as error:
            return Piece(task.number, {"metrics": None, "failure": str(error)})
    if task.exr:
        rendering = rendering.saved(task.exr)
    metrics = rendering.metrics.as_dict()
    measured = {key: value for key, value in metrics.items() if key not in _OF_ALL_POSES}
    if task.second is not None:
        add_measured(measured, scene, task.camera, task.second)
    seen = sight_faces(rendering.image, scene.part, task.include).as_rows()
    return Piece(task.number, {"metrics": measured, "failure": ""}, seen)

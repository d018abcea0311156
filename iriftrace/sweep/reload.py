"""Scene, part and hot air of a sweep, read again from the sources that its file states."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

from attrs import frozen
from numpy.typing import ArrayLike

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.engines import Engine
from iriftrace.core.errors import InputError, SetupError, warn, without_warnings
from iriftrace.core.plain import JsonObject
from iriftrace.io.part_files import read_part
from iriftrace.io.reading import ReadPart
from iriftrace.part.part import Part
from iriftrace.sweep.rig import add_measured, rig_of
from iriftrace.sweep.store import (
    attribute,
    check_unchanged,
    included,
    scene_of,
    scene_of_pose,
)
from iriftrace.tracing.outline import blocker_surfaces, outermost_surface, read_surface

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.tracing.render import Rendering
    from iriftrace.tracing.scene import Scene


@frozen(eq=False)
class SweptScene:
    """Scene of a sweep, with the options of its rendering."""

    scene: Scene
    camera: Camera  # intrinsics and focus interval
    include: tuple[int, ...]  # status codes of the rays that the metrics use

    def render(self, matrix: ArrayLike) -> Rendering:
        """Render from a pose ((4, 4) array, camera to world, mm) as the sweep did.

        Raises InputError if the camera stands in the hot air or in the part.
        """
        from iriftrace.tracing.render import render_scene

        with without_warnings():
            # Limits of a scene were warned of when it was swept.
            return render_scene(
                self.scene,
                camera=self.camera.at(matrix),
                include=self.include,
                empty=True,
            )

    def metrics(self, matrix: ArrayLike) -> JsonObject:
        """Metrics of a pose as the sweep stored them; raises as `render`."""
        camera = self.camera.at(matrix)
        found = self.render(matrix).metrics.as_dict()
        rig = rig_of(self.scene)
        if rig is not None:
            add_measured(found, self.scene, camera, rig.placed(camera.matrix))
        return found


def load_swept_scene(dataset: xr.Dataset, pose: int) -> SweptScene:
    """Load the scene of a pose's number with its focal length, and the engine that was requested.

    Raises InputError, half a sentence, if the sweep does not name it, or its files are missing or
    have changed; SetupError if there is no usable LLVM or CUDA.
    """
    named, part = scene_of_pose(dataset, pose), attribute(dataset, "part")
    if "path" not in named or "path" not in part or not attribute(dataset, "camera"):
        raise InputError("the sweep does not name its scene", code="sweep.no_scene")
    check_unchanged(named["path"], named.get("sha256", ""))
    check_unchanged(part["path"], part.get("sha256", ""))
    for file, sha256 in named.get("files", {}).items():
        check_unchanged(file, sha256)

    from iriftrace.tracing.load import load_scene

    variant = _variant(named.get("variant"))
    with without_warnings():
        # Limits of the scene were warned of when it was swept.
        scene = load_scene(
            named["path"],
            named.get("variables"),
            variant=variant,
            engine=named.get("requested_engine", Engine.AUTO),
        )
    return SweptScene(scene, swept_camera(dataset, pose), included(dataset))


def swept_camera(dataset: xr.Dataset, pose: int) -> Camera:
    """The camera of a pose, with its focal length if a sweep has several; not placed there."""
    focal = float(dataset["focal_length"].values[pose])
    length = focal if math.isfinite(focal) else None
    return Camera.from_dict({**attribute(dataset, "camera"), "focal_length_mm": length})


def _variant(swept: str | None) -> str:
    """The sweep's own variant; if it cannot run, the usual one, with a warning."""
    from iriftrace.core.runtime import variant as runtime

    try:
        return runtime.ensure(swept)
    except SetupError as error:
        if swept is None:
            raise
        usual = runtime.ensure()
        warn(
            f"The sweep was rendered with {swept}, which does not run here ({error}); {usual} is "
            "used instead, which may differ in a few rays."
        )
        return usual


@frozen(eq=False)
class Surroundings:
    """Part and outer surface of the hot air (vertices, faces) that the cameras of a sweep look at.

    Blockers are bodies that only block the view. Vertices are in mm, world; `missing` states in
    half a sentence each why one is None.
    """

    part: Part | None = None
    blockers: tuple[tuple[FloatArray, IntArray], ...] = ()
    hot_air: tuple[FloatArray, IntArray] | None = None
    missing: tuple[str, ...] = ()


def surroundings_of(dataset: xr.Dataset) -> Surroundings:
    """Read part and hot air, if their files have not changed since the sweep."""
    found: JsonObject = {}
    missing = []
    for key, name, read in (
        ("part", "the part", swept_part),
        ("blockers", "what blocks the view", _blockers),
        ("hot_air", "the hot air", _hot_air),
    ):
        try:
            found[key] = read(dataset)
        except InputError as error:
            missing.append(f"{name} ({str(error).rstrip('.')})")
    return Surroundings(**found, missing=tuple(missing))


def swept_part(dataset: xr.Dataset) -> Part:
    """Read the part of a sweep; raises InputError, half a sentence, if its file has changed."""
    named = attribute(dataset, "part")
    if not {"path", "sha256", "length_unit", "to_world"} <= set(named):
        raise InputError("the sweep does not name its file", code="sweep.no_part")
    check_unchanged(named["path"], named["sha256"])
    part = read_part(named["path"], ReadPart(length_unit=named["length_unit"]))
    return part.transformed(named["to_world"])


def _blockers(dataset: xr.Dataset) -> tuple[tuple[FloatArray, IntArray], ...]:
    """None for a scene that has changed since the sweep, which the hot air's reason states."""
    try:
        scene = _unchanged_scene(dataset)
    except InputError:
        return ()
    return tuple(blocker_surfaces(scene))


def _unchanged_scene(dataset: xr.Dataset) -> Path:
    scene, sha256 = scene_of(dataset)
    if scene is None:
        raise InputError("the sweep does not name its scene", code="sweep.no_scene")
    check_unchanged(scene, sha256)
    return scene


def _hot_air(dataset: xr.Dataset) -> tuple[FloatArray, IntArray]:
    outermost = outermost_surface(_unchanged_scene(dataset))
    files = scene_of_pose(dataset, 0).get("files", {})
    if str(outermost.resolve()) in files:
        check_unchanged(outermost, files[str(outermost.resolve())])
    return read_surface(outermost)

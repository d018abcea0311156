"""The scene of a sweep, loaded again to render further poses of it as the sweep did."""

from __future__ import annotations

import json
import math
import warnings
from typing import TYPE_CHECKING

from attrs import frozen
from numpy.typing import ArrayLike

from iriftrace.camera import Camera
from iriftrace.errors import InputError, IriftraceWarning, SetupError
from iriftrace.sweep_origin import attribute, check_unchanged, scene_of_pose

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.render import Rendering
    from iriftrace.scene import LoadedScene


@frozen(eq=False)
class SweptScene:
    """What a sweep rendered, and how.

    Attributes
    ----------
    scene : LoadedScene
    camera : Camera
        Intrinsics and focus interval.
    include : tuple of int
        Status codes of the rays that the metrics use.
    """

    scene: LoadedScene
    camera: Camera
    include: tuple[int, ...]

    def render(self, matrix: ArrayLike, *, nearest: bool = False) -> Rendering:
        """Render from a pose ((4, 4) array, camera to world, mm) as the sweep did.

        Raises
        ------
        InputError
            If the camera stands in the hot air or in the part.
        """
        from iriftrace.render import render_scene

        with warnings.catch_warnings():
            # What limits a scene was said when it was swept.
            warnings.simplefilter("ignore", IriftraceWarning)
            return render_scene(
                self.scene,
                camera=self.camera.at(matrix),
                include=self.include,
                nearest=nearest,
                empty=True,
            )


def load_swept_scene(dataset: xr.Dataset, pose: int) -> SweptScene:
    """Load the scene that a sweep was made of.

    Parameters
    ----------
    dataset
        The sweep.
    pose
        Number of the pose whose scene and focal length are wanted, where a sweep has several.

    Raises
    ------
    InputError
        If the sweep does not name it, or its files are gone or have changed.
    SetupError
        If no usable LLVM or CUDA is there.
    """
    named, part = scene_of_pose(dataset, pose), attribute(dataset, "part")
    camera = attribute(dataset, "camera")
    if "path" not in named or "path" not in part or not camera:
        raise InputError("the sweep does not name its scene")
    check_unchanged(named["path"], named.get("sha256", ""))
    check_unchanged(part["path"], part.get("sha256", ""))
    for file, sha256 in named.get("files", {}).items():
        check_unchanged(file, sha256)

    from iriftrace.scene import load_scene

    variant = _variant(named.get("variant"))
    with warnings.catch_warnings():
        # What limits the scene was said when it was swept.
        warnings.simplefilter("ignore", IriftraceWarning)
        scene = load_scene(
            named["path"],
            named.get("variables"),
            variant=variant,
            engine=named.get("engine"),
        )
    if "focal_length" in dataset:
        focal = float(dataset["focal_length"].values[pose])
        camera = {**camera, "focal_length_mm": focal if math.isfinite(focal) else None}
    include = json.loads(dataset.attrs.get("include", "[0]"))
    return SweptScene(scene, Camera.from_dict(camera), tuple(include))


def _variant(swept: str | None) -> str:
    """The sweep's own variant; where it cannot run, the usual one, which is said."""
    from iriftrace import runtime

    try:
        return runtime.ensure(swept)
    except SetupError as error:
        if swept is None:
            raise
        usual = runtime.ensure()
        warnings.warn(
            f"The sweep was rendered with {swept}, which does not run here ({error}); {usual} is "
            "taken, which may differ in a few rays.",
            IriftraceWarning,
            stacklevel=3,
        )
        return usual

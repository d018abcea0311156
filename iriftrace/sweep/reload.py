"""Scene, part and outermost shell of a sweep, read again by what its file says of them."""

from __future__ import annotations

import json
import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from attrs import frozen
from numpy.typing import ArrayLike, NDArray

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import AnyIntArray
from iriftrace.core.errors import InputError, IriftraceWarning, SetupError
from iriftrace.part.part import Part, read_part
from iriftrace.scene.ensemble import INCLUDED, is_ensemble, member_folder
from iriftrace.shells.files import read_shell
from iriftrace.sweep.store import attribute, check_unchanged, scene_of, scene_of_pose

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.scene.load import LoadedScene
    from iriftrace.trace.render import Rendering


@frozen(eq=False)
class SweptScene:
    """Scene of a sweep, with the options by which it was rendered.

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
        from iriftrace.trace.render import render_scene

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


def load_swept_scene(dataset: xr.Dataset, pose: int, engine: str | None = None) -> SweptScene:
    """Load the scene that a sweep was made of.

    Parameters
    ----------
    dataset
        The sweep.
    pose
        Number of the pose whose scene and focal length are wanted, where a sweep has several.
    engine
        What bends the rays; by default what gave the numbers of this pose.

    Raises
    ------
    InputError
        If the sweep does not name it, or its files are gone or have changed.
    SetupError
        If no usable LLVM or CUDA is there.
    """
    named, part = scene_of_pose(dataset, pose), attribute(dataset, "part")
    if "path" not in named or "path" not in part or not attribute(dataset, "camera"):
        raise InputError("the sweep does not name its scene")
    check_unchanged(named["path"], named.get("sha256", ""))
    check_unchanged(part["path"], part.get("sha256", ""))
    for file, sha256 in named.get("files", {}).items():
        check_unchanged(file, sha256)

    from iriftrace.scene.load import load_scene

    variant = _variant(named.get("variant"))
    through_field = "through_field" in dataset and dataset["through_field"].values[pose] == 1
    traced_with = "continuous" if through_field else named.get("engine")
    with warnings.catch_warnings():
        # What limits the scene was said when it was swept.
        warnings.simplefilter("ignore", IriftraceWarning)
        scene = load_scene(
            named["path"],
            named.get("variables"),
            variant=variant,
            engine=engine or traced_with,
        )
    include = json.loads(dataset.attrs.get("include", "[0]"))
    return SweptScene(scene, swept_camera(dataset, pose), tuple(include))


def swept_camera(dataset: xr.Dataset, pose: int) -> Camera:
    """The camera of a pose, with its focal length where a sweep has several; not placed there."""
    camera = attribute(dataset, "camera")
    if "focal_length" in dataset:
        focal = float(dataset["focal_length"].values[pose])
        camera = {**camera, "focal_length_mm": focal if math.isfinite(focal) else None}
    return Camera.from_dict(camera)


def _variant(swept: str | None) -> str:
    """The sweep's own variant; where it cannot run, the usual one, which is said."""
    from iriftrace.runtime import variant as runtime

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


@frozen(eq=False)
class Surroundings:
    """Part and outermost shell (vertices, faces) that the cameras of a sweep look at.

    Vertices are in mm, world; `missing` says in half a sentence each why one is None.
    """

    part: Part | None = None
    shell: tuple[NDArray[np.float32], AnyIntArray] | None = None
    missing: tuple[str, ...] = ()


def surroundings_of(dataset: xr.Dataset) -> Surroundings:
    """Read part and outermost shell, as far as their files are still what was swept."""
    found: dict[str, Any] = {}
    missing = []
    for key, name, read in (
        ("part", "the part", swept_part),
        ("shell", "the outermost shell", _shell),
    ):
        try:
            found[key] = read(dataset)
        except InputError as error:
            missing.append(f"{name} ({str(error).rstrip('.')})")
    return Surroundings(**found, missing=tuple(missing))


def swept_part(dataset: xr.Dataset) -> Part:
    """Read the part of a sweep; InputError, half a sentence, if its file is not what was swept."""
    named = attribute(dataset, "part")
    if not {"path", "sha256", "length_unit", "to_world"} <= set(named):
        raise InputError("the sweep does not name its file")
    check_unchanged(named["path"], named["sha256"])
    part = read_part(named["path"], length_unit=named["length_unit"])
    return part.transformed(named["to_world"])


def _shell(dataset: xr.Dataset) -> tuple[NDArray[np.float32], AnyIntArray]:
    scene, sha256 = scene_of(dataset)
    if scene is None:
        raise InputError("the sweep does not name its scene")
    check_unchanged(scene, sha256)
    layers = {}
    for shape in _shapes(scene):
        file = shape.find("string[@name='filename']")
        layer = shape.find("bsdf[@type='iso_shell']/string[@name='layer']")
        # What is placed by the scene lies elsewhere than its file says.
        if file is None or layer is None or shape.find("transform") is not None:
            continue
        if layer.get("value", "").isdecimal():
            layers[int(layer.get("value", ""))] = scene.parent / file.get("value", "")
    if not layers:
        raise InputError(f"{scene} names none")
    outermost = layers[min(layers)]
    files = scene_of_pose(dataset, 0).get("files", {})
    if str(outermost.resolve()) in files:
        check_unchanged(outermost, files[str(outermost.resolve())])
    vertices, faces, *_ = read_shell(outermost)
    return vertices, faces


def _shapes(scene: Path) -> list[Element]:
    """Shapes of a scene; of an ensemble's the first member's, which it includes."""
    file = member_folder(scene, 1) / INCLUDED if is_ensemble(scene) else scene
    if not file.is_file():
        raise InputError(f"{file} is gone")
    return list(ElementTree.parse(file).getroot().iter("shape"))

"""The part and the outermost shell of a sweep, found again by what its file says."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.ensemble.members import INCLUDED, is_ensemble, member_folder
from iriftrace.errors import InputError
from iriftrace.part import Part, read_part
from iriftrace.shell_io import read_ply
from iriftrace.shell_mesh import AnyIntArray
from iriftrace.sweep_origin import attribute, check_unchanged, scene_of, scene_of_pose

if TYPE_CHECKING:
    import xarray as xr


@frozen(eq=False)
class Surroundings:
    """What the cameras of a sweep look at.

    Attributes
    ----------
    part : Part or None
    shell : (vertices, faces) or None
        The outermost shell; vertices in mm, world.
    missing : tuple of str
        Why something is None, half a sentence each.
    """

    part: Part | None = None
    shell: tuple[NDArray[np.float32], AnyIntArray] | None = None
    missing: tuple[str, ...] = ()


def surroundings_of(dataset: xr.Dataset) -> Surroundings:
    """Read part and outermost shell, as far as their files are still what was swept."""
    missing = []
    part, shell = None, None
    try:
        part = _part(dataset)
    except InputError as error:
        missing.append(f"the part ({_reason(error)})")
    try:
        shell = _shell(dataset)
    except InputError as error:
        missing.append(f"the outermost shell ({_reason(error)})")
    return Surroundings(part, shell, tuple(missing))


def _reason(error: InputError) -> str:
    return str(error).rstrip(".")


def _part(dataset: xr.Dataset) -> Part:
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
    vertices, faces, *_ = read_ply(outermost)
    return vertices, faces


def _shapes(scene: Path) -> list[Element]:
    """Shapes of a scene; of an ensemble's the first member's, which it includes."""
    file = member_folder(scene, 1) / INCLUDED if is_ensemble(scene) else scene
    if not file.is_file():
        raise InputError(f"{file} is gone")
    return list(ElementTree.parse(file).getroot().iter("shape"))

"""Surfaces of a scene that pictures show next to the part, as its XML file states them."""

from __future__ import annotations

from pathlib import Path

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.io.ply import read_ply
from iriftrace.tracing.ensemble import INCLUDED, is_ensemble, member_folder
from iriftrace.tracing.file import BLOCKER_ID, read_xml


def outermost_surface(scene: Path) -> Path:
    """PLY file of the outermost shell of a scene, or of an ensemble's first member.

    Raises InputError, half a sentence, if there is none, or the scene places it elsewhere.
    """
    file = member_folder(scene, 1) / INCLUDED if is_ensemble(scene) else scene
    if not file.is_file():
        raise InputError(f"{file} is gone", code="file.missing")
    layers = {}
    for shape in read_xml(file).iter("shape"):
        name = shape.find("string[@name='filename']")
        layer = shape.find("bsdf[@type='iso_shell']/string[@name='layer']")
        # A shell with a transform in the scene lies elsewhere than its file states.
        if name is None or layer is None or shape.find("transform") is not None:
            continue
        if layer.get("value", "").isdecimal():
            layers[int(layer.get("value", ""))] = scene.parent / name.get("value", "")
    if not layers:
        raise InputError(f"{scene} names none", code="scene.no_shells")
    return layers[min(layers)]


def blocker_surfaces(scene: Path) -> list[tuple[FloatArray, IntArray]]:
    """Vertices (n, 3), mm, and faces (m, 3) of the bodies that only block the view.

    Only bodies that `iriftrace.tracing.write` wrote. Raises InputError, half a sentence, for
    damaged files.
    """
    found = []
    for shape in read_xml(scene).iter("shape"):
        name = shape.find("string[@name='filename']")
        if name is None or not shape.get("id", "").startswith(BLOCKER_ID):
            continue
        found.append(read_surface(scene.parent / name.get("value", "")))
    return found


def read_surface(file: Path) -> tuple[FloatArray, IntArray]:
    """Vertices (n, 3), mm, and faces (m, 3) of a PLY file; InputError, half a sentence."""
    try:
        mesh = read_ply(file)
    except Exception as error:  # its reader lets any through that a damaged file causes
        raise InputError(f"{file} is damaged ({error})", code="file.damaged") from error
    return mesh.vertices, mesh.faces

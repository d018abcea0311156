"""Where a result comes from and what it assumes, for the header of every file."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

from iriftrace.camera import Camera
from iriftrace.part_file import sha256_of
from iriftrace.scene import LoadedScene

ENGINES = {
    "shells": "nested iso-index shells, Snell's law at each",
    "continuous": "ray equation through the field's own cells, order 4",
}


def provenance(scene: LoadedScene, camera: Camera) -> dict[str, Any]:
    """Version, scene, field, part and assumptions in force, as plain JSON values.

    Parameters
    ----------
    scene : LoadedScene
    camera : Camera
    """
    table = scene.shells_table
    part = scene.part
    notes = table.get("notes") or {}
    source = table.get("source")
    wavelength = (table.get("air") or {}).get("wavelength_nm")
    return {
        "version": version("iriftrace"),
        "scene": {
            "path": str(scene.path.resolve()),
            "sha256": sha256_of(scene.path),
            "variables": scene.variables,
        },
        "engine": scene.engine,
        "index_rule": scene.index_rule,
        "normals": scene.normals,
        "wavelength_nm": wavelength,
        "field": source,
        "part": {
            "path": str(Path(part.path).resolve()),
            "sha256": part.sha256,
            "length_unit": part.length_unit,
            "to_world": scene.part_to_world.tolist(),
        },
        "variant": scene.variant,
        "length_unit": "mm",
        "assumptions": {
            "engine": ENGINES[scene.engine],
            "index_rule": scene.index_rule,
            "normals": scene.normals,
            "field_source": f"{source['quantity']} from {source['path']}"
            if source
            else "not stated",
            "field_time": notes.get("time", "not stated"),
            "field_symmetry": notes.get("symmetry", "not stated"),
            "open_boundary": "air beyond the data is not modelled",
            "camera": camera.lens,
            "wavelength": "not stated" if wavelength is None else f"{wavelength:g} nm",
            "optics": "geometric optics, no diffraction",
            "sampling": "a single ray through each pixel's centre",
            "air": "static during the exposure",
        },
    }

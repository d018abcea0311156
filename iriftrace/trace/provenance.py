"""Origin and assumptions of a result, for the header of every file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from iriftrace.camera.camera import Camera
from iriftrace.core.files import sha256_of
from iriftrace.field.origin import is_steady
from iriftrace.part.part import Part
from iriftrace.scene.load import LoadedEnsemble, LoadedScene

ENGINES = {
    "shells": "nested shells of equal refractive index",
    "continuous": "ray equation through the field's own cells, order 4",
}

_MOST_LISTED = 2


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
    ensemble = scene.ensemble
    sources = [source] if ensemble is None else [m.source for m in ensemble.members]
    wavelength = scene.wavelength_nm
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
        "bending": scene.bending,
        "wavelength_nm": wavelength,
        "field": source,
        **({} if ensemble is None else {"ensemble": _members(ensemble)}),
        "part": {
            "path": str(Path(part.path).resolve()),
            "sha256": part.sha256,
            "source": _users_file(table.get("part") or {}, part),
            "length_unit": part.length_unit,
            "to_world": scene.part_to_world.tolist(),
        },
        "variant": scene.variant,
        "length_unit": "mm",
        "assumptions": {
            "engine": ENGINES[scene.engine],
            "index_rule": scene.index_rule,
            "normals": scene.normals,
            "bending": scene.bending,
            **_for_studies(scene, notes),
            **_fields(sources),
            **({} if ensemble is None else {"ensemble": _meaning(ensemble)}),
            **({"field_member": notes["member"]} if ensemble is None and "member" in notes else {}),
            "field_time": notes.get("time") or _time(sources),
            "field_symmetry": notes.get("symmetry", "not stated"),
            **({"field_fit": notes["fit"]} if "fit" in notes else {}),
            "open_boundary": "air beyond the data is not modelled",
            "camera": camera.lens,
            "wavelength": "not stated" if wavelength is None else f"{wavelength:g} nm",
            "optics": "geometric optics, no diffraction",
            "sampling": "a single ray through each pixel's centre",
            "air": "static during the exposure",
        },
    }


def _users_file(written: Mapping[str, str], part: Part) -> str:
    """Name of the file that the user gave, of which the scene has a copy."""
    same = written.get("sha256") == part.sha256
    return written.get("source", "") if same else Path(part.path).name


def _for_studies(scene: LoadedScene, notes: Mapping[str, str]) -> dict[str, str]:
    """Choices of studies of another program's findings."""
    if scene.engine != "shells":
        return {}
    stated = {"shells": notes["shells"]} if "shells" in notes else {}
    if scene.integrator.inside_hit == "drop":
        stated["inside_hit"] = "rays that meet a shell from its inside are given up"
    return stated


def _members(ensemble: LoadedEnsemble) -> dict[str, Any]:
    return {"count": len(ensemble), "members": [m.as_dict() for m in ensemble.members]}


def _meaning(ensemble: LoadedEnsemble) -> str:
    return (
        f"displacements are means over {len(ensemble)} fields (bias), scatter is the standard "
        "deviation of a sample"
    )


def _fields(sources: Sequence[dict[str, Any] | None]) -> dict[str, str]:
    """Quantity, files and origins of the fields, each said once."""
    known = [source for source in sources if source]
    files = dict.fromkeys(f"{source['quantity']} from {source['path']}" for source in known)
    origins = dict.fromkeys(origin for source in known if (origin := source.get("origin")))
    return {
        "field_source": _listed(files),
        "field_origin": _listed(origins),
    }


def _time(sources: Sequence[dict[str, Any] | None]) -> str:
    """Steadiness as the fields state it, where the user did not."""
    origins = [(source or {}).get("origin") for source in sources]
    return "steady" if all(is_steady(origin) for origin in origins) else "not stated"


def _listed(texts: Iterable[str]) -> str:
    """The first ones of a list, which `ensemble` has in full."""
    found = list(texts)
    rest = [f"and {len(found) - _MOST_LISTED} more"] if len(found) > _MOST_LISTED else []
    return "; ".join([*found[:_MOST_LISTED], *rest]) or "not stated"

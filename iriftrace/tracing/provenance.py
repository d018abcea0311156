"""Origin and assumptions of a result, for the header of every file."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

from iriftrace.camera.camera import Camera
from iriftrace.core.plain import JsonObject, plain
from iriftrace.core.units import counted
from iriftrace.medium.source import FieldSource
from iriftrace.tracing.compiled import Compiled
from iriftrace.tracing.hot_air import OUTSIDE
from iriftrace.tracing.scene import Scene

_MOST_LISTED = 2


def provenance(scene: Scene, camera: Camera) -> JsonObject:
    """Version, scene, field, part and assumptions in force, as plain JSON values."""
    part, compiled = scene.part, scene.compiled
    stated, source, notes = compiled.stated, compiled.source, compiled.stated.notes
    wavelength, written = stated.wavelength_nm, stated.part
    members = [member.as_dict() for member in scene.members]
    known = _weighted(scene) if members else [("", source)] if source else []
    rules = {"index_rule": compiled.index_rule, "normals": compiled.normals}
    return {
        "version": version("iriftrace"),
        "scene": {
            "path": None if scene.path is None else str(scene.path.resolve()),
            "sha256": scene.sha256,
            "variables": scene.variables,
        },
        "engine": compiled.engine.value,
        **rules,
        "bending": compiled.bending.value,
        "wavelength_nm": wavelength,
        "field": plain(source),
        **({"ensemble": {"count": scene.weights.sampled, "members": members}} if members else {}),
        "part": {
            "path": str(Path(part.path).resolve()),
            "sha256": part.sha256,
            # The user's own file, of which the scene has a copy.
            "source": written.source
            if written is not None and written.sha256 == part.sha256
            else Path(part.path).name,
            "length_unit": part.length_unit,
            "to_world": scene.part_to_world.tolist(),
        },
        "variant": compiled.variant,
        "length_unit": "mm",
        "assumptions": {
            "engine": compiled.engine.text,
            **rules,
            "bending": compiled.bending.text,
            **_for_studies(compiled),
            "field_source": _listed(
                f"{weight}{one.quantity} from {one.path}" for weight, one in known
            ),
            "field_origin": _listed(f"{weight}{one.origin}" for weight, one in known if one.origin),
            **({"ensemble": _meaning(scene)} if members else {}),
            **({"field_member": notes["member"]} if not members and "member" in notes else {}),
            # As the fields state it, unless the user did.
            "field_time": notes.get("time") or _listed(one.time for _, one in known if one.time),
            "field_symmetry": notes.get("symmetry")
            or _listed(one.facts.symmetry for _, one in known if one.facts.symmetry),
            **({"field_fit": notes["fit"]} if "fit" in notes else {}),
            **({OUTSIDE: notes[OUTSIDE]} if OUTSIDE in notes else {}),
            "open_boundary": "air beyond the data is not modelled",
            "camera": camera.lens,
            "wavelength": "not stated" if wavelength is None else f"{wavelength:g} nm",
            "optics": "geometric optics, no diffraction",
            "sampling": "a single ray through each pixel's centre",
            "air": "static during the exposure",
        },
    }


def _for_studies(compiled: Compiled) -> dict[str, str]:
    """Choices made to study findings of another program."""
    if getattr(compiled.integrator, "inside_hit", "") != "drop":
        return {}
    return {"inside_hit": "rays that meet a shell from its inside are given up"}


def _weighted(scene: Scene) -> list[tuple[str, FieldSource]]:
    """Fields in an ensemble's mean with their weights as text, the largest first; "" if equal."""
    weights = scene.weights
    rows = zip(weights.weights.tolist(), scene.members, strict=True)
    in_mean = [(weight, member.source) for weight, member in rows if weight > 0.0]
    if weights.equal:
        return [("", source) for _, source in in_mean]
    return [(f"{weight:.1%} ", source) for weight, source in sorted(in_mean, key=lambda r: -r[0])]


def _meaning(scene: Scene) -> str:
    weights = scene.weights
    weighted = "" if weights.equal else f" weighted like {weights.effective:.2g} equal ones"
    if weights.covariance is not None:
        weighted += " by a fit to a measurement"
    varied = sum(member.variation is not None for member in scene.members)
    more = f"; {counted(varied, 'further field')} for what inputs change" if varied else ""
    if not weights.several:
        return f"displacements are those of one field{more}"
    return (
        f"displacements are means over {counted(weights.sampled, 'field')}{weighted} (bias), "
        f"scatter is the standard deviation of a sample{more}"
    )


def _listed(texts: Iterable[str]) -> str:
    """The first of some texts, without repetitions; `ensemble` has all."""
    found = list(dict.fromkeys(texts))
    rest = [f"and {len(found) - _MOST_LISTED} more"] if len(found) > _MOST_LISTED else []
    return "; ".join([*found[:_MOST_LISTED], *rest]) or "not stated"

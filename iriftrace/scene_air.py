"""What a scene's own files say of its air, and what of that still holds."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from iriftrace.errors import InputError, IriftraceWarning
from iriftrace.scene_file import SceneFile


def shells_table_of(file: SceneFile) -> dict[str, Any]:
    """The table beside the shells; empty when there is none.

    Raises
    ------
    InputError
        It is damaged.
    """
    folders = {path.parent for path in file.shell_paths}
    for folder in folders:
        table = folder / "shells.json"
        if table.is_file():
            try:
                content = json.loads(table.read_text(encoding="utf-8"))
            except ValueError as error:
                raise InputError(
                    f"{table} is damaged ({error}); write the scene again, or remove the file "
                    "(then results do not state the field)."
                ) from error
            return content if isinstance(content, dict) else {}
    return {}


def field_table(cells: Any, shells: dict[str, Any], path: Path) -> dict[str, Any]:
    """What the field's file says of air and source, and the notes beside the shells."""
    theirs = (shells.get("source") or {}).get("sha256", cells.source["sha256"])
    if theirs != cells.source["sha256"]:
        warnings.warn(
            f"The shells of {path} were made from another field than its field file, so the two "
            "engines trace different air; write the scene again.",
            IriftraceWarning,
            stacklevel=3,
        )
    return {"air": cells.air, "source": cells.source, "notes": shells.get("notes")}


def stated_normals(wanted: str, tables: Any) -> str:
    """Which normals bend rays: the wanted ones, and for how many shells not."""
    if wanted == "facet" or not tables.has_normals:
        return "facet"
    without = len(tables.facet_shells)
    return f"gradient, but facet for {without} of the shells" if without else wanted


def stated_bending(integrator: Any, tables: Any) -> str:
    """Where shells bend rays, and why not all along the layers if that was wanted."""
    if integrator.bends_in_layers(tables):
        return "all along the layers"
    if integrator.bending == "layers" and integrator.normals == "gradient":
        return "at the shells alone, which do not say how steep the index is"
    return "at the shells alone"


def stated_index_rule(path: Path, table: dict[str, Any], tables: Any) -> str:
    """The table's rule, as long as the scene has the table's shells."""
    rule: str | None = table.get("rule")
    if rule is None:
        return "not stated"
    if tables.stock_shells:
        return f"edited: {rule} shells as Mitsuba's dielectric"
    pairs = tables.index_pairs
    listed = [(1 + row["ext"], 1 + row["int"]) for row in table.get("shells", [])]
    kept = sum(any(np.allclose(pair, own, rtol=0, atol=1e-12) for own in pairs) for pair in listed)
    if kept == len(listed) == len(pairs):
        return rule
    warnings.warn(
        f"{path} has {len(pairs)} shells, {kept} of the {len(listed)} that were made for it, so "
        "the air is cut into other layers than the field asks for; results say that it was edited.",
        IriftraceWarning,
        stacklevel=3,
    )
    return f"edited: {kept} of {len(listed)} {rule} shells, {len(pairs) - kept} others"

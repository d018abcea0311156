"""What a scene's own files say of its air, and what of that still holds."""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from iriftrace.checksum import sha256_of
from iriftrace.errors import InputError, IriftraceWarning
from iriftrace.part import Part
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


def other_shells(file: SceneFile, table: dict[str, Any]) -> tuple[str, ...]:
    """Names of the shells whose files are not those that were written with their table.

    Warns
    -----
    IriftraceWarning
        There are some.
    """
    stated = {row.get("file"): row.get("sha256") for row in table.get("shells", [])}
    others = tuple(
        path.name
        for path in file.shell_paths
        if stated.get(path.name) not in (None, sha256_of(path))
    )
    if others:
        warnings.warn(
            f"{', '.join(others)} in {file.shell_paths[0].parent} are not the shells that the "
            "scene was written with, so rays meet other air than its table tells of; write the "
            "scene again. Results say that it was edited.",
            IriftraceWarning,
            stacklevel=3,
        )
    return others


def warn_of_another_part(file: SceneFile, part: Part, table: dict[str, Any]) -> None:
    """Warn when the part's file was replaced; a scene may name another one on purpose."""
    written = table.get("part") or {}
    places = [(shell.parent / written.get("file", "")).resolve() for shell in file.shell_paths]
    if file.part_path.resolve() in places and written.get("sha256") != part.sha256:
        warnings.warn(
            f"{part.path} is not the part that the scene was written with, so the air may be that "
            "of another part; write the scene again with this one.",
            IriftraceWarning,
            stacklevel=3,
        )


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


def stated_index_rule(path: Path, table: dict[str, Any], tables: Any, others: Sequence[str]) -> str:
    """The table's rule, as long as the scene has the table's shells and none of `others`."""
    rule: str | None = table.get("rule")
    if rule is None:
        return "not stated"
    if tables.stock_shells:
        return f"edited: {rule} shells as Mitsuba's dielectric"
    pairs = tables.index_pairs
    listed = [(1 + row["ext"], 1 + row["int"]) for row in table.get("shells", [])]
    kept = sum(any(np.allclose(pair, own, rtol=0, atol=1e-12) for own in pairs) for pair in listed)
    if kept == len(listed) == len(pairs):
        return f"edited: {len(others)} of {len(pairs)} {rule} shells changed" if others else rule
    warnings.warn(
        f"{path} has {len(pairs)} shells, {kept} of the {len(listed)} that were made for it, so "
        "the air is cut into other layers than the field asks for; results say that it was edited.",
        IriftraceWarning,
        stacklevel=3,
    )
    return f"edited: {kept} of {len(listed)} {rule} shells, {len(pairs) - kept} others"

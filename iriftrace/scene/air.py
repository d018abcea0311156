"""Statements of a scene's own files on its air, and checks that they still hold."""

from __future__ import annotations

import json
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from iriftrace.core.engines import Bending
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.files import sha256_of
from iriftrace.part.part import Part
from iriftrace.scene.file import SceneFile


def shells_table_of(file: SceneFile) -> dict[str, Any]:
    """The table beside the shells; empty when there is none, refused when it is damaged."""
    table = _table_file(file)
    if table is None:
        return {}
    try:
        content: dict[str, Any] = json.loads(table.read_text(encoding="utf-8"))
        _check_kinds(content)
    except ValueError as error:
        raise InputError(
            f"{table} is damaged ({error}); write the scene again, or remove the file (then "
            "results do not state the field)."
        ) from error
    return content


def _table_file(file: SceneFile) -> Path | None:
    """The first table there is, should shells lie in several folders."""
    tables = (path.parent / "shells.json" for path in file.shell_paths)
    return next(filter(Path.is_file, tables), None)


def _check_kinds(table: Any) -> None:
    """Raise ValueError where a table is no object of objects, as what follows takes for granted."""
    if not isinstance(table, dict):
        raise ValueError("it is no object")
    for name in ("air", "source", "notes", "part"):
        if not isinstance(table.get(name) or {}, dict):
            raise ValueError(f"{name} is no object")
    shells = table.get("shells", [])
    if not (isinstance(shells, list) and all(isinstance(row, dict) for row in shells)):
        raise ValueError("shells is no list of objects")
    if not all(isinstance(row.get(key), int | float) for row in shells for key in ("ext", "int")):
        raise ValueError("a shell has no indices")
    part = table.get("part") or {}
    if not all(isinstance(value, str) for value in part.values()):
        raise ValueError("part has something else than texts")


def other_shells(file: SceneFile, table: dict[str, Any]) -> tuple[str, ...]:
    """Shells, warned of, whose files are not those that were written with the table."""
    place = _table_file(file)
    rows = [row for row in table.get("shells", []) if "sha256" in row]
    if place is None or not rows:
        return ()
    stated = {(place.parent / str(row.get("file"))).resolve(): row["sha256"] for row in rows}
    others = tuple(
        str(path) for path in file.shell_paths if stated.get(path.resolve()) != sha256_of(path)
    )
    if others:
        warnings.warn(
            f"{', '.join(others)} {'is' if len(others) == 1 else 'are'} not of the shells that "
            f"{place} was written with, so rays meet other air than it tells of; write the scene "
            "again.",
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


def field_table(cells: Any, shells: dict[str, Any], name: str) -> dict[str, Any]:
    """Air and source as the field's file states them; notes and part as beside the shells."""
    theirs = (shells.get("source") or {}).get("sha256", cells.source["sha256"])
    if theirs != cells.source["sha256"]:
        warnings.warn(
            f"The shells of {name} were made from another field than its field file, so the two "
            "engines trace different air; write the scene again.",
            IriftraceWarning,
            stacklevel=3,
        )
    kept = {name: shells.get(name) for name in ("notes", "part")}
    return {"air": cells.air, "source": cells.source, **kept}


def stated_normals(wanted: str, tables: Any) -> str:
    """Normals that bend rays: the wanted ones, and for how many shells not."""
    if wanted == "facet" or not tables.has_normals:
        return "facet"
    without = len(tables.facet_shells)
    return f"gradient, but facet for {without} of the shells" if without else wanted


def stated_bending(integrator: Any, tables: Any) -> Bending:
    """Places where rays are bent by shells."""
    if integrator.bends_in_layers(tables):
        return Bending.LAYERS
    if integrator.bending == "layers" and integrator.normals == "gradient":
        return Bending.SHELLS_WITHOUT_DERIVATIVES
    return Bending.SHELLS


def stated_index_rule(name: str, table: dict[str, Any], tables: Any, others: Sequence[str]) -> str:
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
        f"{name} has {len(pairs)} shells, {kept} of the {len(listed)} that were made for it, so "
        "the air is cut into other layers than the field asks for; results say that it was edited.",
        IriftraceWarning,
        stacklevel=3,
    )
    return f"edited: {kept} of {len(listed)} {rule} shells, {len(pairs) - kept} others"

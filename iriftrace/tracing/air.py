"""Facts about a scene's air: what its files state, whether it still holds, and what is traced."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
from attrs import evolve

from iriftrace.core.engines import Bending, Engine
from iriftrace.core.errors import warn
from iriftrace.core.files import sha256_of
from iriftrace.core.plain import structured
from iriftrace.io.refusals import damaged
from iriftrace.io.shells import TABLE
from iriftrace.medium.path_data import FieldCells
from iriftrace.medium.shells.table import AirStatement, PartOrigin
from iriftrace.part.part import Part
from iriftrace.tracing.file import SceneFile

if TYPE_CHECKING:
    from iriftrace.plugins.kernels.tables import SceneTables

Integrator = Any
"""``first_hit`` or ``gradient_path``: their classes are created again for each variant."""


def air_statement_of(file: SceneFile) -> AirStatement:
    """The table next to the shells; empty if there is none, refused if it is damaged."""
    table = _table_file(file)
    if table is None:
        return AirStatement()
    try:
        return structured(json.loads(table.read_text(encoding="utf-8")), AirStatement)
    except ValueError as error:
        remedy = "write the scene again, or remove the file (then results do not state the field)"
        raise damaged(table, error, remedy) from error


def _table_file(file: SceneFile) -> Path | None:
    """The first table that exists, if shells lie in several folders."""
    tables = (path.parent / TABLE for path in file.shell_paths)
    return next(filter(Path.is_file, tables), None)


def other_shells(file: SceneFile, stated: AirStatement) -> tuple[str, ...]:
    """Shells whose files are not those that were written with the table, with a warning."""
    place = _table_file(file)
    rows = [row for row in stated.shells if row.sha256]
    if place is None or not rows:
        return ()
    known = {(place.parent / row.file).resolve(): row.sha256 for row in rows}
    others = tuple(
        str(path) for path in file.shell_paths if known.get(path.resolve()) != sha256_of(path)
    )
    if others:
        warn(
            f"{', '.join(others)} {'is' if len(others) == 1 else 'are'} not among the shells that "
            f"{place} was written with, so rays meet other air than it states; write the scene "
            "again."
        )
    return others


def warn_of_another_part(file: SceneFile, part: Part, written: PartOrigin | None) -> None:
    """Warn when the part's file was replaced; a scene may name another one on purpose."""
    if written is None:
        return
    places = [(shell.parent / written.file).resolve() for shell in file.shell_paths]
    if file.part_path.resolve() in places and written.sha256 != part.sha256:
        warn(
            f"{part.path} is not the part that the scene was written with, so the air may be that "
            "of another part; write the scene again with this one."
        )


def statement_of_field(cells: FieldCells, shells: AirStatement, name: str) -> AirStatement:
    """Air and source as the field's file states them; the rest as next to the shells."""
    if shells.source is not None and shells.source.state != cells.source.state:
        warn(
            f"The shells of {name} were made from another field than its field file, so the two "
            "engines trace different air; write the scene again."
        )
    return evolve(shells, air=cells.air, source=cells.source)


def stated_normals(requested: str, tables: SceneTables) -> str:
    """The requested normals, and the number of shells that do not have them."""
    if requested == "facet" or not tables.has_normals:
        return "facet"
    without = len(tables.facet_shells)
    return f"gradient, but facet for {without} of the shells" if without else requested


def stated_index_rule(
    name: str, stated: AirStatement, tables: SceneTables, others: Sequence[str]
) -> str:
    """The stated rule, if the scene has the stated shells and none of `others`."""
    rule = stated.rule
    if rule is None:
        tables.warn_of_missing_shells(name)
        return "not stated"
    if tables.stock_shells:
        return f"edited: {rule} shells as Mitsuba's dielectric"
    pairs = tables.index_pairs
    listed = [(1 + row.ext, 1 + row.int_) for row in stated.shells]
    kept = sum(any(np.allclose(pair, own, rtol=0, atol=1e-12) for own in pairs) for pair in listed)
    if kept == len(listed) == len(pairs):
        return f"edited: {len(others)} of {len(pairs)} {rule} shells changed" if others else rule
    warn(
        f"{name} has {len(pairs)} shells, {kept} of the {len(listed)} that were made for it, so "
        "the air has other layers than the field requires; results state that it was edited."
    )
    return f"edited: {kept} of {len(listed)} {rule} shells, {len(pairs) - kept} others"


class TracedAir(TypedDict):
    """Attributes of `Compiled` that describe its air."""

    engine: Engine
    normals: str
    bending: Bending
    index_rule: str
    stated: AirStatement


def traced_air(
    integrator: Integrator,
    stated: AirStatement,
    name: str,
    tables: SceneTables,
    others: tuple[str, ...] = (),
) -> TracedAir:
    """The air of a scene; `others` are shells that are not those stated."""
    engine = Engine(integrator.engine)
    if engine.through_cells:
        return {
            "engine": engine,
            "normals": f"{integrator.gradient} gradient",
            "bending": Bending.CELLS,
            "index_rule": "none, linear in each tetrahedron",
            "stated": statement_of_field(integrator.air.cells, stated, name),
        }
    return {
        "engine": engine,
        "normals": stated_normals(integrator.normals, tables),
        "bending": _bending(integrator, tables),
        "index_rule": stated_index_rule(name, stated, tables, others),
        "stated": stated,
    }


def _bending(integrator: Integrator, tables: SceneTables) -> Bending:
    """Where the shells bend rays."""
    if integrator.bends_in_layers(tables):
        return Bending.LAYERS
    if integrator.bending == "layers" and integrator.normals == "gradient":
        return Bending.SHELLS_WITHOUT_DERIVATIVES
    return Bending.SHELLS

"""The integrator that traces a scene's rays with the requested engine, and facts about its air."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

from iriftrace.core.engines import AUTO, ENGINES, Bending
from iriftrace.core.errors import InputError
from iriftrace.core.units import parse_quantity
from iriftrace.field.path_data import FIELD_FILE
from iriftrace.scene.air import stated_index_rule, stated_normals, statement_of_field
from iriftrace.scene.ensemble import MEMBER, is_ensemble, member_folder
from iriftrace.scene.wavelength import WAVELENGTH
from iriftrace.shells.table import AirStatement

if TYPE_CHECKING:
    from iriftrace.plugins.kernels.tables import SceneTables


Integrator = Any
"""``first_hit`` or ``gradient_path``: their classes are created again for each variant."""


class TracedAir(TypedDict):
    """Attributes of a `LoadedScene` that describe its air."""

    engine: str
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
    if integrator.engine == "cells":
        return {
            "engine": "cells",
            "normals": f"{integrator.gradient} gradient",
            "bending": Bending.CELLS,
            "index_rule": "none, linear in each tetrahedron",
            "stated": statement_of_field(integrator.air.cells, stated, name),
        }
    return {
        "engine": integrator.engine,
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


def field_file(path: Path, values: Mapping[str, str]) -> Path:
    """The cells engine's field next to a scene, or that of its member."""
    folder = member_folder(path, values.get(MEMBER, "1")) if is_ensemble(path) else path.parent
    return folder / FIELD_FILE


def set_wavelength(integrator: Integrator, values: Mapping[str, str]) -> None:
    """Set another wavelength than that of the cells engine's field, if requested."""
    if WAVELENGTH in values:
        integrator.wavelength_nm = parse_quantity(values[WAVELENGTH], "nm")


def integrator_for(own: Integrator, engine: str, name: str, field_file: Path) -> Integrator:
    """The scene's own integrator, or one for the requested engine."""
    import mitsuba as mi

    check_engine(engine)
    if not hasattr(own, "image"):
        raise InputError(
            f"{name} has the integrator {own.class_name()}, which computes light and not hits; use "
            '<integrator type="first_hit"/>.'
        )
    if engine in (AUTO, own.engine):
        return own
    # The two kinds of normals have counterparts: each kind converges to its gradient.
    smooth = own.normals == "gradient" if engine == "cells" else own.gradient == "recovered"
    if engine == "shells":
        chosen = {"type": "first_hit", "normals": "gradient" if smooth else "facet"}
    else:
        chosen = {
            "type": "gradient_path",
            "field": str(field_file.resolve()),
            "gradient": "recovered" if smooth else "constant",
        }
    return mi.load_dict({**chosen, "trace_all": own.trace_all})


def check_engine(engine: str) -> None:
    """Refuse an engine that does not exist."""
    known = (AUTO, *ENGINES)
    if engine not in known:
        raise InputError(f"There is no engine {engine!r}; use one of {', '.join(known)}.")

"""The study ``mesh``: what the resolution of the flow solution changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any

from iriftrace.errors import InputError
from iriftrace.field import IndexField
from iriftrace.studies.comparison import Axis, Comparison
from iriftrace.studies.differences import Hits
from iriftrace.studies.finest import Finest, check_references, references_of
from iriftrace.studies.mode import Mode, shells_of
from iriftrace.studies.pictures import View, picture_of_shells
from iriftrace.studies.split_cells import as_tetrahedra, split_tetrahedra

TETRAHEDRA = " as tetrahedra"
SPLIT = "+"


def mesh_study(
    fields: Mapping[str, IndexField],
    view: View,
    modes: Sequence[Mode],
    references: Sequence[str],
    source: Mapping[str, Any],
    *,
    layers: int = 13,
    split: Sequence[str] = (),
) -> Comparison:
    """Compare fields of several resolutions with the last of them, cut at the same levels.

    Parameters
    ----------
    fields : mapping
        Fields by name, the finest last.
    view : View
    modes : sequence of Mode
    references : sequence of str
        See :mod:`iriftrace.studies.finest`.
    source : mapping
        See :class:`iriftrace.studies.comparison.Comparison`.
    layers : int
        Number of shells.
    split : sequence of str
        Names of fields that are also contoured after their cells were divided into tetrahedra
        (`TETRAHEDRA` is put after the name), and after these were split into eight (`SPLIT`).
        Between the last two only coplanar triangles are added.

    Raises
    ------
    InputError
        If there is one field only, or a name to split is none of theirs.
    """
    names = list(fields)
    if len(names) < 2:
        raise InputError(
            "A study of resolutions needs at least two fields, coarse to fine; give another one."
        )
    for name in split:
        if name not in fields:
            raise InputError(
                f"There is no field {name} to split; the study has {', '.join(names)}."
            )
    for mode in modes:
        mode.check_layers(layers, len(names))
    check_references(tuple(references))
    cases = [
        case
        for name in names
        for case in ((name, name + TETRAHEDRA, name + SPLIT) if name in split else (name,))
    ]
    target = Finest(fields[names[-1]], len(names) - 1, layers)

    # A split field can need gigabytes.
    @lru_cache(maxsize=1)
    def field_of(case: str) -> IndexField:
        if case in fields:
            return fields[case]
        if case.endswith(TETRAHEDRA):
            return as_tetrahedra(fields[case.removesuffix(TETRAHEDRA)])
        return split_tetrahedra(as_tetrahedra(fields[case.removesuffix(SPLIT)]))

    def trace(mode: Mode, position: int) -> Hits | None:
        case = cases[position]
        origin = case if case in fields else case.removesuffix(TETRAHEDRA).removesuffix(SPLIT)
        stack = shells_of(
            field_of(case),
            layers,
            mode,
            number=names.index(origin),
            index_range=target.index_range,
        )
        return None if stack is None else picture_of_shells(view, stack, mode)

    return Comparison(
        name="mesh",
        axis=Axis("field", tuple(cases), "field, coarse to fine"),
        modes=tuple(modes),
        references=tuple(references),
        trace=trace,
        reference=references_of(target, view),
        source={**source, "layers": layers},
    )

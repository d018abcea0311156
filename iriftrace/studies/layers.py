"""The study ``layers``: what the number of shells changes.

Against a stack of 20 shells with facet normals, the difference has a local maximum at six shells,
which is no property of six. By the outer rule shell k of N lies at the share k / N of the index
range, so all shells of 4, 5 or 10 are shells of the 20 too, with the same facets and the same
errors of these, which cancel. Six is the first number after a dip; against 24 shells the dips are
at 6, 8 and 12, and against the continuous engine, or with gradient normals, there are none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from iriftrace.errors import InputError
from iriftrace.field import IndexField
from iriftrace.studies.comparison import Axis, Comparison
from iriftrace.studies.differences import Hits
from iriftrace.studies.mode import Mode, shells_of
from iriftrace.studies.pictures import View, picture_of_field, picture_of_shells

CONTINUOUS = "continuous"
LINEAR_CELLS = "linear cells"
THE_PAPERS = 20
"""Shells of the reference of Kern et al. (2025)."""


def layers_study(
    field: IndexField,
    view: View,
    layers: Sequence[int],
    modes: Sequence[Mode],
    references: Sequence[str],
    source: Mapping[str, Any],
) -> Comparison:
    """Compare numbers of shells with references.

    Parameters
    ----------
    field : IndexField
    view : View
    layers : sequence of int
        Numbers of shells.
    modes : sequence of Mode
    references : sequence of str
        ``"continuous"``: the continuous engine, the same for every mode. ``"linear cells"``:
        likewise, on the field that is linear in each cell, to which facet normals converge. A
        number: a stack of as many shells in the case's own mode; 20 is the paper's.
    source : mapping
        See :class:`iriftrace.studies.comparison.Comparison`.

    Raises
    ------
    InputError
        If a number of shells is below 1, or a reference is unknown.
    """
    if any(count < 1 for count in layers):
        raise InputError(f"{min(layers)} shells bend no ray; give numbers of at least 1.")
    for mode in modes:
        mode.check_fields(1)
    for name in references:
        if name not in (CONTINUOUS, LINEAR_CELLS) and not (name.isdecimal() and int(name) > 0):
            raise InputError(
                f'"{name}" is no reference; give "{CONTINUOUS}", "{LINEAR_CELLS}" or a number of '
                f"shells, such as {THE_PAPERS}."
            )
    continuous: dict[str, Hits] = {}

    def shells(mode: Mode, count: int) -> Hits | None:
        stack = shells_of(field, count, mode)
        return None if stack is None else picture_of_shells(view, stack, mode)

    def reference(mode: Mode, name: str) -> Hits | None:
        if name.isdecimal():
            return shells(mode, int(name))
        if name not in continuous:
            normals = "gradient" if name == CONTINUOUS else "facet"
            continuous[name] = picture_of_field(view, field, normals=normals)
        return continuous[name]

    return Comparison(
        name="layers",
        axis=Axis("layers", tuple(layers), "number of shells"),
        modes=tuple(modes),
        references=tuple(references),
        trace=lambda mode, position: shells(mode, layers[position]),
        reference=reference,
        source=source,
    )

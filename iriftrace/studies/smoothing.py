"""The study ``smoothing``: what smoothing the shells of a coarse field changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from attrs import evolve

from iriftrace.field import IndexField
from iriftrace.shell_edit import smooth_taubin
from iriftrace.shell_stack import ShellStack
from iriftrace.studies.comparison import Axis, Comparison
from iriftrace.studies.differences import Hits
from iriftrace.studies.finest import Finest, check_references, references_of
from iriftrace.studies.mode import Mode, shells_of
from iriftrace.studies.pictures import View, picture_of_shells


def smoothing_study(
    field: IndexField,
    finest: IndexField,
    view: View,
    iterations: Sequence[int],
    modes: Sequence[Mode],
    references: Sequence[str],
    source: Mapping[str, Any],
    *,
    layers: int = 13,
) -> Comparison:
    """Compare shells of one field, smoothed by Taubin's method, with those of a finer field.

    Parameters
    ----------
    field, finest : IndexField
        Smoothed, and left as it is; fields 0 and 1 for `Mode.drop_inner`.
    view : View
    iterations : sequence of int
        Of `iriftrace.shell_edit.smooth_taubin`.
    modes : sequence of Mode
        Gradient normals and steepness stay with their vertices, because they belong to the field
        and not to the facets.
    references : sequence of str
        See :mod:`iriftrace.studies.finest`.
    source : mapping
        See :class:`iriftrace.studies.comparison.Comparison`.
    layers : int
        Number of shells.
    """
    for mode in modes:
        mode.check_layers(layers, 2)
    check_references(tuple(references))
    unsmoothed: dict[str, ShellStack | None] = {}
    target = Finest(finest, 1, layers)

    def trace(mode: Mode, position: int) -> Hits | None:
        if mode.name not in unsmoothed:
            unsmoothed[mode.name] = shells_of(
                field, layers, mode, number=0, index_range=target.index_range
            )
        stack = unsmoothed[mode.name]
        if stack is None:
            return None
        return picture_of_shells(view, smoothed(stack, iterations[position]), mode)

    return Comparison(
        name="smoothing",
        axis=Axis("iterations", tuple(iterations), "Taubin smoothing iterations"),
        modes=tuple(modes),
        references=tuple(references),
        trace=trace,
        reference=references_of(target, view),
        source={**source, "layers": layers},
    )


def smoothed(stack: ShellStack, iterations: int) -> ShellStack:
    """Smooth the surfaces; each vertex keeps the gradient that it had."""
    changed = smooth_taubin(stack, iterations)
    shells = [
        evolve(after, normals=before.normals, steepness=before.steepness)
        for before, after in zip(stack.shells, changed.shells, strict=True)
    ]
    return evolve(changed, shells=shells)

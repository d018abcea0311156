"""Studies of accuracy: number of shells, smoothing, and resolution of the flow solution.

Against a stack of 20 shells with facet normals, the difference has a local maximum at six shells,
which is no property of six. By the outer rule shell k of N lies at the share k / N of the index
range, so all shells of 4, 5 or 10 are shells of the 20 too, with the same facets and the same
errors of these, which cancel. Six is the first number after a dip; against 24 shells the dips are
at 6, 8 and 12, and against the continuous engine, or with gradient normals, there are none.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.field.index_field import IndexField
from iriftrace.shells.edit import smooth_taubin
from iriftrace.shells.stack import ShellStack
from iriftrace.studies.modes import CONTINUOUS, LINEAR_CELLS, SAME_MODE, Mode, shells_of
from iriftrace.studies.picture import View
from iriftrace.studies.split_cells import as_tetrahedra, split_tetrahedra
from iriftrace.studies.study import Axis, References, Study, source_of

THE_PAPERS = 20
"""Shells of the reference of Kern et al. (2025)."""

TETRAHEDRA = " as tetrahedra"
SPLIT = "+"


def layers_study(
    field: IndexField,
    view: View,
    layers: Sequence[int],
    modes: Sequence[Mode],
    references: Sequence[str] | None = None,
) -> Study:
    """Compare numbers of shells with references.

    Parameters
    ----------
    field : IndexField
    view : View
    layers : sequence of int
        Numbers of shells.
    modes : sequence of Mode
    references : sequence of str, optional
        ``"continuous"``, ``"linear cells"`` (see `iriftrace.studies.study.References`), or a
        number: a stack of as many shells in the case's own mode. By default 20, as in the paper,
        and continuous.

    Raises
    ------
    InputError
        If a number of shells is below 1, or a reference is unknown.
    """
    if any(count < 1 for count in layers):
        raise InputError(f"{min(layers)} shells bend no ray; give numbers of at least 1.")
    for mode in modes:
        mode.check_fields(1)
    names = references or (str(THE_PAPERS), CONTINUOUS)
    for name in names:
        if name not in (CONTINUOUS, LINEAR_CELLS) and not (name.isdecimal() and int(name) > 0):
            raise InputError(
                f'"{name}" is no reference; give "{CONTINUOUS}", "{LINEAR_CELLS}" or a number of '
                f"shells, such as {THE_PAPERS}."
            )
    return Study(
        name="layers",
        axis=Axis("layers", tuple(layers), "number of shells"),
        modes=tuple(modes),
        view=lambda position: view,
        stack=lambda mode, position: shells_of(field, layers[position], mode),
        source=source_of(view, [field]),
        references=References(
            tuple(names), field, lambda mode, name: shells_of(field, int(name), mode)
        ),
    )


def smoothing_study(
    field: IndexField,
    finest: IndexField,
    view: View,
    iterations: Sequence[int],
    modes: Sequence[Mode],
    references: Sequence[str] | None = None,
    *,
    layers: int = 13,
) -> Study:
    """Compare shells of one field, smoothed by Taubin's method, with those of a finer field.

    Parameters
    ----------
    field, finest : IndexField
        Smoothed, and left as it is; fields 0 and 1 for `Mode.drop_inner`.
    view : View
    iterations : sequence of int
        Of `iriftrace.shells.edit.smooth_taubin`.
    modes : sequence of Mode
        The gradient normals and their derivatives stay with their vertices, because they belong to
        the field and not to the facets.
    references : sequence of str, optional
        ``"same mode"``: shells of the finest field in the case's own mode, as in Kern et al.
        (2025). ``"continuous"``: the continuous engine on that field. By default both.
    layers : int
        Number of shells.
    """
    fields = [field, finest]
    for mode in modes:
        mode.check_layers(layers, len(fields))

    @lru_cache(maxsize=len(modes))
    def unsmoothed(mode: Mode) -> ShellStack | None:
        return shells_of(field, layers, mode, number=0, index_range=_range(finest))

    def stack(mode: Mode, position: int) -> ShellStack | None:
        before = unsmoothed(mode)
        return None if before is None else smoothed(before, iterations[position])

    return Study(
        name="smoothing",
        axis=Axis("iterations", tuple(iterations), "Taubin smoothing iterations"),
        modes=tuple(modes),
        view=lambda position: view,
        stack=stack,
        source=source_of(view, fields, layers=layers),
        references=_finest(fields, layers, references),
    )


def mesh_study(
    fields: Mapping[str, IndexField],
    view: View,
    modes: Sequence[Mode],
    references: Sequence[str] | None = None,
    *,
    layers: int = 13,
    split: Sequence[str] = (),
) -> Study:
    """Compare fields of several resolutions with the last of them, cut at the same levels.

    Parameters
    ----------
    fields : mapping
        Fields by name, the finest last.
    view : View
    modes : sequence of Mode
    references : sequence of str, optional
        See `smoothing_study`.
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
    names, given = list(fields), list(fields.values())
    if len(names) < 2:
        raise InputError(
            "A study of resolutions needs at least two fields, coarse to fine; give another one."
        )
    for name in split:
        if name not in fields:
            listed = ", ".join(names)
            raise InputError(f"There is no field {name} to split; the study has {listed}.")
    for mode in modes:
        mode.check_layers(layers, len(names))
    # Name, original field and what is done to it.
    cases = [
        (name + suffix, number, suffix)
        for number, name in enumerate(names)
        for suffix in (("", TETRAHEDRA, SPLIT) if name in split else ("",))
    ]

    # A split field can need gigabytes.
    @lru_cache(maxsize=1)
    def cut(position: int) -> IndexField:
        _, number, suffix = cases[position]
        if not suffix:
            return given[number]
        tetrahedra = as_tetrahedra(given[number])
        return tetrahedra if suffix == TETRAHEDRA else split_tetrahedra(tetrahedra)

    def stack(mode: Mode, position: int) -> ShellStack | None:
        number, field = cases[position][1], cut(position)
        return shells_of(field, layers, mode, number=number, index_range=_range(given[-1]))

    return Study(
        name="mesh",
        axis=Axis("field", tuple(case for case, _, _ in cases), "field, coarse to fine"),
        modes=tuple(modes),
        view=lambda position: view,
        stack=stack,
        source=source_of(view, given, layers=layers),
        references=_finest(given, layers, references),
    )


def _range(finest: IndexField) -> tuple[float, float]:
    """n - 1 of the ambient and the hottest air, which give all fields the same levels."""
    return finest.ambient_refractivity, finest.hottest_refractivity


def _finest(
    fields: Sequence[IndexField], layers: int, references: Sequence[str] | None
) -> References:
    names = references or (SAME_MODE, CONTINUOUS)
    for name in names:
        if name not in (SAME_MODE, CONTINUOUS):
            raise InputError(
                f'"{name}" is no reference; give "{SAME_MODE}" (shells of the finest field) or '
                f'"{CONTINUOUS}" (the continuous engine on the finest field).'
            )
    finest, number = fields[-1], len(fields) - 1
    return References(
        tuple(names),
        finest,
        lambda mode, name: shells_of(
            finest, layers, mode, number=number, index_range=_range(finest)
        ),
    )


def smoothed(stack: ShellStack, iterations: int) -> ShellStack:
    """Smooth the surfaces; each vertex keeps the gradient that it had."""
    changed = smooth_taubin(stack, iterations)
    shells = [
        evolve(after, normals=before.normals, derivatives=before.derivatives)
        for before, after in zip(stack.shells, changed.shells, strict=True)
    ]
    return evolve(changed, shells=shells)

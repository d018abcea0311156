"""The hot air around a part: one field, or several of an ensemble, each with shells and cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING

from attrs import Factory, frozen

from iriftrace.core.errors import InputError
from iriftrace.core.member_weights import MemberWeights

if TYPE_CHECKING:
    from iriftrace.field.index_field import IndexField
    from iriftrace.field.part_fit import Fit
    from iriftrace.field.path_data import FieldCells
    from iriftrace.part.part import Part
    from iriftrace.shells.report import ShellReport
    from iriftrace.shells.stack import ShellStack


OUTSIDE = "outside_members"
"""Note on an ensemble with fitted weights whose members do not contain the measured air."""


@frozen(eq=False)
class AirState:
    """One state of the air; its shells and cells are made when they are first needed."""

    field: IndexField | None  # None for ready-made shells
    label: str = ""  # distinguishes it from the other states of an ensemble
    time: float | None = None  # in the file's unit
    weight: float = 1.0  # relative to that of the other states
    covariance: list[float] | None = None  # row of the covariance of fitted weights
    layers: int = 13
    rule: str = "rim"
    ready: ShellStack | None = None  # used instead of shells from layers and rule
    report: Sequence[ShellReport] | None = None  # facts about the shells, for their table
    notes: Mapping[str, str] = Factory(dict)  # stated in every result, besides those of the air

    @cached_property
    def shells(self) -> ShellStack:
        """Surfaces of equal index between layers of air."""
        from iriftrace.shells.contour import contour_shells

        if self.ready is not None:
            return self.ready
        assert self.field is not None
        return contour_shells(self.field, self.layers, rule=self.rule)

    @cached_property
    def cells(self) -> FieldCells | None:
        """Cells of the field with the index at their corners; None without a field."""
        from iriftrace.field.path_data import cells_of

        return None if self.field is None else cells_of(self.field)

    def fit(
        self, part: Part, blockers: Sequence[Part], wall_temperature_k: float | None
    ) -> Fit | None:
        """How field and part lie relative to each other; None for ready-made shells."""
        from iriftrace.field.part_fit import fit_part_to_field

        if self.field is None:
            return None
        return fit_part_to_field(
            self.field, part, wall_temperature_k=wall_temperature_k, blockers=blockers
        )


@frozen(eq=False, init=False)
class HotAir:
    """The hot air around a part, and how its shells bend rays.

    It has two descriptions: nested shells of equal refractive index, and the cells of the field.
    `Scene.engine` selects the one that bends rays.

    Attributes
    ----------
    states : tuple of AirState
        One state, or several of an ensemble.
    normals : str
        Parameter of ``first_hit`` for the shells.
    notes : mapping of str
        Facts about the field, such as ``{"time": "snapshot"}``; stated in every result.
    wall_temperature_k : float or None, K
        Temperature of the hot part; if a field has another one at its wall, a warning is issued.
    """

    states: tuple[AirState, ...]
    normals: str
    notes: Mapping[str, str]
    wall_temperature_k: float | None

    def __init__(
        self,
        field: IndexField | Sequence[IndexField] | None = None,
        *,
        layers: int = 13,
        rule: str = "rim",
        shells: ShellStack | None = None,
        labels: Sequence[str] = (),
        weights: Sequence[float] | MemberWeights = (),
        normals: str = "gradient",
        notes: Mapping[str, str] | None = None,
        wall_temperature_k: float | None = None,
    ) -> None:
        """Use one field, or several of one part as an ensemble.

        Parameters
        ----------
        field : IndexField, sequence of IndexField or None
            None with ready-made `shells` (:func:`iriftrace.import_shells`).
        layers : int
            Number of shells.
        rule : str
            See :func:`iriftrace.contour_shells`.
        shells : ShellStack, optional
            Used instead of those from `layers` and `rule`; for one field.
        labels : sequence of str
            Names of several fields; by default those of their files.
        weights : sequence of float or MemberWeights
            Relative weights of several fields, 0 or more; equal by default. Means and scatter
            of results are weighted. Those of :func:`iriftrace.fit_members` have a covariance.
        normals, notes, wall_temperature_k
            See the attributes.

        Raises
        ------
        InputError
            There is neither a field nor shells, but the name of a file, there are shells of several
            fields, not as many labels or weights as fields, or a weight is negative.
        """
        if isinstance(field, str | PathLike):
            raise InputError(
                f"HotAir takes a field and not the name of its file; give "
                f'iriftrace.read_field("{field}").'
            )
        several = isinstance(field, Sequence)
        fields = list(field) if isinstance(field, Sequence) else [field]
        if not fields or (fields[0] is None and shells is None):
            raise InputError("A scene needs air that bends its rays; give a field, or shells.")
        if several and shells is not None:
            raise InputError(
                "Ready-made shells belong to one field, but several are given; omit the shells."
            )
        names = list(labels) or ["" if one is None else f"{one.source.path}" for one in fields]
        if len(names) != len(fields):
            raise InputError(f"There are {len(names)} labels for {len(fields)} fields.")
        if not isinstance(weights, MemberWeights):
            weights = MemberWeights(list(weights) or [1.0] * len(fields))
        if len(weights.weights) != len(fields):
            raise InputError(
                f"There are {len(weights.weights)} weights for {len(fields)} fields; give one for "
                "each."
            )
        states = tuple(
            AirState(one, name, None, weight, row, layers, rule, shells)
            for one, name, (weight, row) in zip(fields, names, weights.rows, strict=True)
        )
        outside = {OUTSIDE: weights.outside} if weights.outside else {}
        known = {**outside, **(notes or {})}
        self.__attrs_init__(states, normals, known, wall_temperature_k)

    def __repr__(self) -> str:
        return f"HotAir({', '.join(repr(s.field or s.shells) for s in self.states)})"

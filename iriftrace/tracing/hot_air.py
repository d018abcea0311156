"""The hot air around a part: one field, or several of an ensemble, each with shells and cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from attrs import Factory, evolve, field, frozen

from iriftrace.core.errors import InputError
from iriftrace.core.files import short_names
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.plain import JsonObject, plain
from iriftrace.io.field_npz import load_field_file
from iriftrace.medium.path_data import FieldCells, cells_of
from iriftrace.medium.shells.levels import RULES
from iriftrace.medium.shells.options import STANDARD
from iriftrace.medium.source import FieldSource, Variation
from iriftrace.tracing.options import GRADIENT

if TYPE_CHECKING:
    from iriftrace.medium.index_field import IndexField
    from iriftrace.medium.part_fit import Fit
    from iriftrace.medium.shells.report import ShellReport
    from iriftrace.medium.shells.stack import ShellStack
    from iriftrace.part.part import Part


OUTSIDE = "outside_members"
"""Note on an ensemble with fitted weights whose members do not contain the measured air."""


@frozen(eq=False)
class AirFiles:
    """Files of one state of the air in a scene's folder; None for what there is not."""

    shells: Path | None  # folder of the shells
    field: Path | None
    source: FieldSource | None  # what the shells come from


@frozen(eq=False)
class AirState:
    """One state of the air; its shells and cells are made, or read, when they are needed."""

    field: IndexField | None  # None for ready-made shells, and for what lies in files
    label: str = ""  # distinguishes it from the other states of an ensemble
    time: float | None = None  # in the file's unit
    weight: float = 1.0  # relative to that of the other states
    covariance: list[float] | None = None  # row of the covariance of fitted weights
    layers: int = STANDARD.layers
    rule: str = STANDARD.rule
    ready: ShellStack | None = None  # used instead of shells from layers and rule
    report: Sequence[ShellReport] | None = None  # facts about the shells, for their table
    notes: Mapping[str, str] = Factory(dict)  # stated in every result, besides those of the air
    files: AirFiles | None = None  # in place of field and shells

    @property
    def shells(self) -> ShellStack:
        """Surfaces of equal index between layers of air."""
        if self.files is None:
            return self._cut
        if self.files.shells is None:
            raise InputError(
                "The shells of this scene are known to Mitsuba alone, as they were made or moved "
                "there, so nothing else can be made of them; give it the air of a field.",
                code="shells.of_mitsuba",
            )
        from iriftrace.io.shells import load_shells

        return load_shells(self.files.shells)

    @cached_property
    def _cut(self) -> ShellStack:
        from iriftrace.medium.shells.contour import contour_shells

        if self.ready is not None:
            return self.ready
        assert self.field is not None
        return contour_shells(self.field, self.layers, rule=self.rule)

    @property
    def cells(self) -> FieldCells:
        """Cells of the field with the index at their corners; InputError without a field."""
        if self.files is not None and self.files.field is not None:
            return load_field_file(self.files.field)
        if self._of_field is None:
            raise InputError(
                "The air of the scene has ready-made shells and no field, so there are no cells to "
                "trace through; give HotAir the field.",
                code="air.no_field",
            )
        return self._of_field

    @cached_property
    def _of_field(self) -> FieldCells | None:
        return None if self.field is None else cells_of(self.field)

    @property
    def source(self) -> FieldSource | None:
        """What the shells come from."""
        return self.shells.source if self.files is None else self.files.source

    def with_notes(self, notes: Mapping[str, str]) -> AirState:
        """The same state, with the same shells, and further notes."""
        return evolve(self, ready=self.shells, notes={**self.notes, **notes})

    def fit(
        self, part: Part, blockers: Sequence[Part], wall_temperature_k: float | None
    ) -> Fit | None:
        """How field and part lie relative to each other; None for ready-made shells."""
        from iriftrace.medium.part_fit import fit_part_to_field

        if self.field is None:
            return None
        variation = self.field.source.facts.variation
        if wall_temperature_k is not None and variation is not None:
            wall_temperature_k += variation.step if variation.quantity == "wall" else 0.0
        return fit_part_to_field(
            self.field, part, wall_temperature_k=wall_temperature_k, blockers=blockers
        )


@frozen
class FieldMember:
    """One field of an ensemble."""

    number: int  # from 1
    label: str  # distinguishes it from the others: a time step, a parameter, a file's name
    time: float | None  # in the file's own unit, if it states one
    source: FieldSource
    weight: float = 1.0  # relative to that of the others
    covariance: list[float] | None = field(default=None, repr=False)  # row of a fit's weights

    @classmethod
    def of(cls, number: int, state: AirState) -> FieldMember:
        """The member that is one state of an ensemble's air."""
        source = state.source
        if source is None:
            raise InputError(
                f"The shells of member {number} do not state the field they come from, which "
                "results must name; make them from a field.",
                code="shells.no_source",
            )
        # A field that varies another one says what an input changes, and is not in the mean.
        weight = state.weight if source.facts.variation is None else 0.0
        return cls(number, state.label, state.time, source, weight, state.covariance)

    @property
    def state(self) -> tuple[str, str, float | None]:
        """Key of its air, the same in another scene."""
        return *self.source.state, self.time

    @property
    def variation(self) -> Variation | None:
        """What it varies in another member; None for a state of the air."""
        return self.source.facts.variation

    @property
    def counts(self) -> bool:
        """True if it is in the mean, or in the covariance of fitted weights."""
        return self.weight > 0.0 or any(self.covariance or ())

    def as_dict(self) -> JsonObject:
        """Plain JSON values."""
        values: JsonObject = plain(self)
        if self.covariance is None:
            del values["covariance"]
        return values


def check_variations(members: Sequence[FieldMember]) -> None:
    """Refuse members of which one varies a field that is not among them, with an InputError.

    The first one must be a field by itself, since scene and air are stated as those of the first.
    """
    known = {one.source.sha256 for one in members if one.variation is None}
    varied = [(v.of, v.quantity) for v in (one.variation for one in members) if v is not None]
    if (members and members[0].variation is not None) or len(set(varied)) < len(varied):
        raise InputError(
            "The first field varies another one, or one input is varied twice; name the field that "
            "was solved with all inputs as they are first, and each variation once.",
            code="air.variations",
            argument="member",
        )
    for one in members:
        if one.variation is not None and one.variation.of not in known:
            raise InputError(
                f'Member {one.number} ("{one.label}") {one.variation.text} of a field that is not '
                "in the scene; make the scene with both, or solve the variation again if that "
                "field was.",
                code="air.varies_nothing",
                argument="member",
            )


def solved_again(members: Sequence[FieldMember], quantity: str) -> list[tuple[int, int, float]]:
    """Places from 0 of each member that varies an input and of what it varies, and the step."""
    place = {one.source.sha256: number for number, one in enumerate(members)}
    return [
        (number, place[one.variation.of], one.variation.step)
        for number, one in enumerate(members)
        if one.variation is not None and one.variation.quantity == quantity
    ]


def weights_of(members: Sequence[FieldMember]) -> MemberWeights:
    """Weights of an ensemble's members, with their covariance if they were fitted."""
    return MemberWeights.of([m.weight for m in members], [m.covariance for m in members])


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
        layers: int = STANDARD.layers,
        rule: str = STANDARD.rule,
        shells: ShellStack | None = None,
        labels: Sequence[str] = (),
        weights: Sequence[float] | MemberWeights = (),
        normals: str = GRADIENT,
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
                f'iriftrace.read_field("{field}").',
                code="field.wrong_type",
                argument="field",
            )
        several = isinstance(field, Sequence)
        fields = list(field) if isinstance(field, Sequence) else [field]
        if not fields or (fields[0] is None and shells is None):
            raise InputError(
                "A scene needs air that bends its rays; give a field, or shells.", code="air.none"
            )
        if several and shells is not None:
            raise InputError(
                "Ready-made shells belong to one field, but several are given; omit the shells.",
                code="shells.several_fields",
            )
        names = list(labels) or short_names(
            ["" if one is None else one.source.path for one in fields]
        )
        if len(names) != len(fields):
            raise InputError(
                f"There are {len(names)} labels for {len(fields)} fields.",
                code="field.label_count",
                argument="labels",
            )
        if not isinstance(weights, MemberWeights):
            weights = MemberWeights(list(weights) or [1.0] * len(fields))
        if len(weights.weights) != len(fields):
            raise InputError(
                f"There are {len(weights.weights)} weights for {len(fields)} fields; give one for "
                "each.",
                code="field.weight_count",
                argument="weights",
            )
        states = tuple(
            AirState(one, name, None, weight, row, layers, rule, shells)
            for one, name, (weight, row) in zip(fields, names, weights.rows, strict=True)
        )
        outside = {OUTSIDE: weights.outside} if weights.outside else {}
        known = {**outside, **(notes or {})}
        self.__attrs_init__(states, normals, known, wall_temperature_k)

    def __repr__(self) -> str:
        return f"HotAir({', '.join(repr(s.field or s.files or s.shells) for s in self.states)})"

    @classmethod
    def of_states(
        cls,
        states: Sequence[AirState],
        *,
        normals: str = GRADIENT,
        notes: Mapping[str, str] | None = None,
        wall_temperature_k: float | None = None,
    ) -> HotAir:
        """Air of given states; see the attributes."""
        air = cls.__new__(cls)
        air.__attrs_init__(tuple(states), normals, notes or {}, wall_temperature_k)
        return air

    def with_states(self, states: Sequence[AirState], notes: Mapping[str, str] = {}) -> HotAir:
        """The same air with other states, and further notes."""
        return self.of_states(
            states,
            normals=self.normals,
            notes={**self.notes, **notes},
            wall_temperature_k=self.wall_temperature_k,
        )

    def with_fields(
        self, fields: Sequence[IndexField], labels: Sequence[str], weights: MemberWeights
    ) -> HotAir:
        """Air of other fields, with the same notes and as many shells as its first state."""
        shells = self.states[0].shells
        return HotAir(
            fields,
            layers=len(shells.shells),
            rule=shells.rule if shells.rule in RULES else STANDARD.rule,
            labels=labels,
            weights=weights,
            normals=self.normals,
            notes=self.notes,
        )

    @cached_property
    def members(self) -> tuple[FieldMember, ...]:
        """The states of an ensemble; empty for one state."""
        if len(self.states) == 1:
            return ()
        members = tuple(FieldMember.of(n, state) for n, state in enumerate(self.states, start=1))
        check_variations(members)
        return members

    def alone(self, number: int) -> HotAir:
        """The air of one member of an ensemble, by its number from 1."""
        state = self.states[number - 1]
        return self.with_states([state], {"member": f"{number}: {state.label}"})

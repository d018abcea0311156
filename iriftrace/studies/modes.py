"""Modes of a study: how the air is cut into shells and rays are refracted; ours, the paper's."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

from attrs import Attribute, asdict, evolve, field, frozen

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.field.index_field import IndexField
from iriftrace.shells.contour import contour_shells
from iriftrace.shells.levels import RULES
from iriftrace.shells.stack import ShellStack

SAME_MODE = "same mode"
CONTINUOUS = "continuous"
LINEAR_CELLS = "linear cells"
"""Names of references: shells of the finest field in a case's own mode, the continuous engine, and
the same with one gradient in each cell."""


def _one_of(*allowed: str) -> Callable[[Any, Attribute[str], str], None]:
    def check(_: Any, choice: Attribute[str], value: str) -> None:
        if value not in allowed:
            raise InputError(
                f"Unknown {choice.name.replace('_', ' ')} '{value}'; use one of "
                f"{', '.join(allowed)}."
            )

    return check


@frozen
class Mode:
    """Making of shells from a field, and the fate of a ray that meets them.

    Attributes
    ----------
    name : str
    normals : str
        ``"gradient"`` (of the index, interpolated) or ``"facet"``.
    index_rule : str
        See :func:`iriftrace.shells.levels.index_levels`.
    inside_hit : str
        What becomes of a ray that meets a shell from its inside, because it leaves the hot air
        again before it meets the part, or because the shell is folded over: ``"refract"`` it like
        any other, or ``"drop"`` it, so that it counts as a ray without a hit (status 6).
    drop_inner : tuple of int
        How many of the innermost shells are left out of each of a study's fields, or one number for
        all of them. Their index steps are left out too: the rays run on to the part in the air of
        the last shell that is kept.
    """

    name: str
    normals: str = field(default="gradient", validator=_one_of("gradient", "facet"))
    index_rule: str = field(default=RULES[0], validator=_one_of(*RULES))
    inside_hit: str = field(default="refract", validator=_one_of("refract", "drop"))
    drop_inner: tuple[int, ...] = field(default=(0,), converter=tuple[int, ...])

    @drop_inner.validator
    def _check_drop_inner(self, _: Attribute[tuple[int, ...]], value: tuple[int, ...]) -> None:
        if not value or min(value) < 0:
            raise InputError(
                f"{', '.join(map(str, value)) or 'Nothing'} is no number of inner shells to leave "
                "out; give 0 or more, one number or one for each field."
            )

    def dropped(self, number: int) -> int:
        """Inner shells to leave out of field ``number``, counted from 0."""
        return self.drop_inner[number] if len(self.drop_inner) > 1 else self.drop_inner[0]

    def leaves(self, layers: int, number: int = 0) -> bool:
        """Whether a shell is left of ``layers`` levels of field ``number``.

        By the outer rule the last level is the hottest air itself and has no surface.
        """
        reached = layers - 1 if self.index_rule == "outer" else layers
        return min(reached, layers - self.dropped(number)) > 0

    def check_layers(self, layers: int, fields: int) -> None:
        """Raise InputError if no shell is left in one of a study's fields."""
        self.check_fields(fields)
        if not all(self.leaves(layers, number) for number in range(fields)):
            raise InputError(
                f"Of {layers} shells the mode '{self.name}' leaves none to trace; give more "
                "layers, or leave fewer inner ones out."
            )

    def check_fields(self, count: int) -> None:
        """Raise InputError if ``drop_inner`` lists other than ``count`` fields."""
        if len(self.drop_inner) not in (1, count):
            raise InputError(
                f"There are {len(self.drop_inner)} numbers of inner shells to leave out, but the "
                f"study has {count} fields; give one number, or one for each field."
            )

    def describe(self) -> str:
        """The mode in words, for legends."""
        words = [f"{self.normals} normals", f"{self.index_rule} rule"]
        words += ["inside hits dropped"] if self.inside_hit == "drop" else []
        if any(self.drop_inner):
            words.append(f"{'/'.join(map(str, self.drop_inner))} inner shells left out")
        return f"{self.name}: {', '.join(words)}"

    def as_dict(self) -> dict[str, object]:
        """Plain JSON values."""
        return {**asdict(self), "drop_inner": list(self.drop_inner)}


OURS = Mode("ours")
PAPERS = Mode("paper's", normals="facet", index_rule="outer", inside_hit="drop")


def one_change_each(papers: Mode) -> list[Mode]:
    """The paper's mode with one of its choices at a time replaced by ours, to see which matters."""
    changes = {
        "normals": "gradient normals",
        "index_rule": f"{OURS.index_rule} rule",
        "inside_hit": "inside hits refracted",
        "drop_inner": "all shells",
    }
    return [
        evolve(papers, name=f"{papers.name} but {text}", **{choice: getattr(OURS, choice)})
        for choice, text in changes.items()
        if getattr(papers, choice) != getattr(OURS, choice)
    ]


def shells_of(
    field: IndexField,
    layers: int,
    mode: Mode,
    *,
    number: int = 0,
    index_range: tuple[float, float] | None = None,
) -> ShellStack | None:
    """Shells of the study's field ``number``, from 0, as a mode wants them; None if none is left.

    Of ``layers`` levels the ``drop_inner`` innermost *levels* are left out, whether the field
    reaches them or not. The range is that of :func:`iriftrace.shells.contour.contour_shells`.
    """
    if layers > 0 and not mode.leaves(layers, number):
        return None
    with warnings.catch_warnings():
        # The empty last level of the outer rule is part of the mode.
        warnings.simplefilter("ignore", IriftraceWarning)
        stack = contour_shells(field, layers, rule=mode.index_rule, index_range=index_range)
    kept = [shell for shell in stack.shells if shell.layer <= layers - mode.dropped(number)]
    return evolve(stack, shells=kept) if kept else None


def some_shells_of(field: IndexField, layers: int, mode: Mode) -> ShellStack:
    """Shells of a study's only field; InputError if none is left."""
    stack = shells_of(field, layers, mode)
    if stack is None:
        raise InputError(
            f"Of {layers} shells the mode '{mode.name}' leaves none that the field reaches; give "
            "more layers, or leave fewer inner ones out."
        )
    return stack

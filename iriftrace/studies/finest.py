"""The reference of studies over several fields: the finest of them, unchanged."""

from __future__ import annotations

from collections.abc import Callable

from attrs import frozen

from iriftrace.errors import InputError
from iriftrace.field import IndexField
from iriftrace.studies.differences import Hits
from iriftrace.studies.layers import CONTINUOUS
from iriftrace.studies.mode import Mode, shells_of
from iriftrace.studies.pictures import View, picture_of_field, picture_of_shells

SAME_MODE = "same mode"
"""Shells of the finest field in the case's own mode, as in Kern et al. (2025)."""


@frozen(eq=False)
class Finest:
    """The finest field of a study.

    Attributes
    ----------
    field : IndexField
    number : int
        Which of the study's fields it is, for `Mode.drop_inner`.
    layers : int
        Number of shells.
    """

    field: IndexField
    number: int
    layers: int

    @property
    def index_range(self) -> tuple[float, float]:
        """n - 1 of the ambient and the hottest air, which give all fields the same levels."""
        return self.field.ambient_refractivity, self.field.hottest_refractivity


def references_of(finest: Finest, view: View) -> Callable[[Mode, str], Hits | None]:
    """From a mode and ``SAME_MODE`` or ``"continuous"`` to the reference's hits."""
    continuous: list[Hits] = []

    def reference(mode: Mode, name: str) -> Hits | None:
        if name == SAME_MODE:
            stack = shells_of(
                finest.field,
                finest.layers,
                mode,
                number=finest.number,
                index_range=finest.index_range,
            )
            return None if stack is None else picture_of_shells(view, stack, mode)
        if not continuous:
            continuous.append(picture_of_field(view, finest.field))
        return continuous[0]

    return reference


def check_references(names: tuple[str, ...]) -> None:
    """Raise InputError for a name that is no reference."""
    for name in names:
        if name not in (SAME_MODE, CONTINUOUS):
            raise InputError(
                f'"{name}" is no reference; give "{SAME_MODE}" (shells of the finest field) or '
                f'"{CONTINUOUS}" (the continuous engine on the finest field).'
            )

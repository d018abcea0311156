"""Names of the engines that bend rays, and of the places where rays are bent."""

from __future__ import annotations

from enum import StrEnum
from typing import Self

from iriftrace.core.errors import InputError


class Engine(StrEnum):
    """An engine as a scene requests it and as a result names it, with what differs between them.

    Attributes
    ----------
    text : str
        Half a sentence.
    free : bool
        No engine is requested: the scene file's own bends the rays, and the field's cells do where
        its shells are too coarse.
    may_use_field : bool
        The rays need the field's own cells, or may come to do so.
    through_cells : bool
        Rays run through the cells and meet no shells, so that the shells' files, normals and index
        rule do not matter.
    """

    AUTO = "auto", "shells, or cells where the shells are too coarse", True, True
    SHELLS = "shells", "nested shells of equal refractive index"
    CELLS = "cells", "ray equation through the field's own cells, order 4", False, True, True

    text: str
    free: bool
    may_use_field: bool
    through_cells: bool

    def __new__(
        cls,
        name: str,
        text: str = "",
        free: bool = False,
        may_use_field: bool = False,
        through_cells: bool = False,
    ) -> Self:
        """The member of a name, with its facts."""
        engine = str.__new__(cls, name)
        engine._value_ = name
        engine.text, engine.free = text, free
        engine.may_use_field, engine.through_cells = may_use_field, through_cells
        return engine


def engine_named(name: str) -> Engine:
    """The engine of a name; InputError if there is none."""
    try:
        return Engine(name)
    except ValueError:
        raise InputError(
            f"There is no engine {name!r}; use one of {', '.join(Engine)}.",
            code="engine.unknown_name",
            argument="engine",
        ) from None


class Bending(StrEnum):
    """Where rays are bent; the value stands in headers and files."""

    LAYERS = "layers"
    SHELLS = "shells"
    SHELLS_WITHOUT_DERIVATIVES = "shells without derivatives"
    CELLS = "cells"

    @property
    def text(self) -> str:
        """Half a sentence."""
        return {
            Bending.LAYERS: "all along the layers",
            Bending.SHELLS: "at the shells alone",
            Bending.SHELLS_WITHOUT_DERIVATIVES: (
                "at the shells alone, as their files do not have the index's derivatives"
            ),
            Bending.CELLS: "continuously",
        }[self]

    @property
    def at_shells_alone(self) -> bool:
        """Whether rays run straight between shells."""
        return self in (Bending.SHELLS, Bending.SHELLS_WITHOUT_DERIVATIVES)

"""The members of an ensemble in memory: as many as fit, the others loaded when they are needed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from iriftrace.ensemble.members import FieldMember

if TYPE_CHECKING:
    from iriftrace.scene import LoadedScene

KEPT_TRIANGLES = 10_000_000
"""Triangles of shells that stay in memory between poses, about 1.5 GB with Mitsuba's own tree."""


class LoadedEnsemble:
    """Members of an ensemble's scene, ready to be traced one after the other.

    Parameters
    ----------
    members : tuple of FieldMember
    load : callable
        Loads the scene of one member, by its number.
    """

    def __init__(
        self, members: tuple[FieldMember, ...], load: Callable[[int], LoadedScene]
    ) -> None:
        self.members = members
        self._load = load
        self._kept: dict[int, LoadedScene] = {}
        self._triangles = 0

    def __len__(self) -> int:
        return len(self.members)

    def scenes(self) -> Iterator[LoadedScene]:
        """Every member's scene, in their order; what does not fit is let go after its turn."""
        for member in self.members:
            if member.number in self._kept:
                yield self._kept[member.number]
                continue
            scene = self._load(member.number)
            triangles = sum(row.get("triangles", 0) for row in scene.shells_table.get("shells", []))
            if self._triangles + triangles <= KEPT_TRIANGLES:
                self._triangles += triangles
                self._kept[member.number] = scene
                yield scene
            else:
                try:
                    yield scene
                finally:
                    scene.integrator.forget()

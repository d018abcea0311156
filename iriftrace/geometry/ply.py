"""Corners of triangles in a PLY: 16 bits each where a mesh's vertices can be numbered with them."""

from __future__ import annotations

from typing import NamedTuple


class CornerType(NamedTuple):
    """A type of vertex numbers, by PLY's name and NumPy's."""

    ply: str
    numpy: str

    @property
    def line(self) -> str:
        """The header's line for a list of corners."""
        return f"property list uchar {self.ply} vertex_indices"


NARROW, WIDE = CornerType("ushort", "<u2"), CornerType("int", "<i4")


def corner_type(vertices: int) -> CornerType:
    """The smallest type that numbers so many vertices."""
    return NARROW if vertices <= 1 << 16 else WIDE

"""Size, openings, gaps and cuts of a stack of shells, shell by shell."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from attrs import asdict, frozen

from iriftrace.core.mesh.query import Surface
from iriftrace.core.mesh.topology import open_edges
from iriftrace.core.plain import JsonObject

if TYPE_CHECKING:
    from iriftrace.medium.index_field import IndexField
    from iriftrace.medium.shells.stack import Shell, ShellStack
    from iriftrace.part.part import Part


PART_WALL = "part wall"
DATA_BOUNDARY = "data boundary"
INTERIOR = "interior"
UNKNOWN = "unknown"

# A part's own surface replaces the field's wall up to the gap that the fit of both tolerates.
_PART_TOLERANCE_MM = 0.2


@frozen
class ShellReport:
    """Facts about one shell.

    Parameters
    ----------
    layer : int
        1 = outermost.
    refractivity, index : float
        n - 1 and n at the surface.
    temperature_k : float, K
    ext, int_ : float
        n - 1 of the layers outside and inside.
    triangles : int
    area_mm2 : float, mm^2
    closed : bool
        Whether the surface has no border.
    open_at : tuple of (str, int)
        Where the border edges lie and how many: ``"part wall"``, ``"data boundary"``,
        ``"interior"`` (a crack, or cut on purpose), ``"unknown"`` without a field.
    gap_next_mm : float or None, mm
        Smallest distance to the next shell inwards; None for the last.
    gap_part_mm : float or None, mm
        Smallest distance to the part's surface, 0 where the shell cuts it; None without a part.
    part_cut_share : float or None
        Fraction of the shell's area inside the part; None without a part or when it is not closed.
    """

    layer: int
    refractivity: float
    index: float
    temperature_k: float
    ext: float
    int_: float
    triangles: int
    area_mm2: float
    closed: bool
    open_at: tuple[tuple[str, int], ...]
    gap_next_mm: float | None
    gap_part_mm: float | None
    part_cut_share: float | None

    def as_dict(self) -> JsonObject:
        """Plain values for JSON."""
        values = asdict(self)
        values["int"] = values.pop("int_")
        values["open_at"] = dict(self.open_at)
        return values


def report_shells(
    stack: ShellStack, field: IndexField | None = None, part: Part | None = None
) -> tuple[ShellReport, ...]:
    """Report on every shell of a stack.

    Distances are those of `iriftrace.core.mesh.query.Surface.gap`, which uses a subset of the
    vertices of a large surface. A triangle counts as inside the part if its centre is.

    Parameters
    ----------
    stack : ShellStack
    field : IndexField, optional
        Used to find where the data end, and so why a shell is open.
    part : Part, optional

    Returns
    -------
    tuple of ShellReport
        Outermost first.
    """
    borders = _borders(field, part)
    surfaces = [Surface(shell.vertices, shell.faces) for shell in stack.shells]
    gaps: list[float | None] = [outer.gap(inner) for outer, inner in pairwise(surfaces)]
    reports = []
    for shell, surface, gap_next, temperature in zip(
        stack.shells, surfaces, [*gaps, None], stack.temperature_k.tolist(), strict=True
    ):
        open_at = _open_at(shell, borders, INTERIOR if field is not None else UNKNOWN)
        inside = None
        if part is not None and part.closed:
            covered = part.surface.inside(surface.vertices[surface.faces].sum(axis=1) / 3.0)
            inside = float(surface.areas[covered].sum() / surface.areas.sum())
        gap_part = None if part is None else surface.gap(part.surface)
        reports.append(
            ShellReport(
                layer=shell.layer,
                refractivity=shell.refractivity,
                index=1.0 + shell.refractivity,
                temperature_k=temperature,
                ext=shell.ext,
                int_=shell.int_,
                triangles=len(shell.faces),
                area_mm2=float(surface.areas.sum()),
                closed=not open_at,
                open_at=open_at,
                gap_next_mm=gap_next,
                gap_part_mm=0.0 if inside else gap_part,
                part_cut_share=inside,
            )
        )
    return tuple(reports)


def _borders(field: IndexField | None, part: Part | None) -> list[tuple[str, Surface, float]]:
    """Surfaces on which shells may end, what they are called, and how near is on them (mm)."""
    borders = []
    has_wall = field is not None and field.wall.n_cells > 0
    if part is not None and not has_wall:
        borders.append((PART_WALL, part.surface, _PART_TOLERANCE_MM))
    if field is not None:
        # Vertices lie on the cells' edges but for the rounding to float32.
        tolerance = max(1e-4, 2e-6 * float(field.grid.length))
        if has_wall:
            wall = Surface(field.wall.points, field.wall.regular_faces)
            borders.append((PART_WALL, wall, tolerance))
        outside = field.grid.extract_surface(algorithm="geometry").triangulate()
        boundary = Surface(outside.points, outside.regular_faces)
        borders.append((DATA_BOUNDARY, boundary, tolerance))
    return borders


def _open_at(
    shell: Shell, borders: Sequence[tuple[str, Surface, float]], otherwise: str
) -> tuple[tuple[str, int], ...]:
    """Border edges of a shell by the surface on which both their ends lie."""
    edges = open_edges(shell.faces)
    counts = {}
    for name, surface, tolerance in borders:
        if len(edges) == 0:
            break
        distance = surface.distance(shell.vertices[edges.ravel()])
        on = np.all(distance.reshape(-1, 2) <= tolerance, axis=1)
        counts[name] = int(on.sum())
        edges = edges[~on]
    counts[otherwise] = len(edges)
    return tuple((name, count) for name, count in counts.items() if count)

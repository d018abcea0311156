"""Shells where they are at their worst, against the cells engine through the same field."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from iriftrace.core.mesh.triangles import polydata
from iriftrace.core.runtime.variant import ensure
from iriftrace.image.aov_image import Status
from iriftrace.image.ray_statistics import RayCounts
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.stack import ShellStack
from iriftrace.scenes import folder_of
from iriftrace.scenes.analytic import CYLINDER_RADIUS_MM
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.scene import Scene
from validation.inputs.cameras import camera_at
from validation.line import Line, Section
from validation.paper.differences import (
    Differences,
    Hits,
    compare,
    displacement_statistics,
    hits_of,
)
from validation.paper.mode import Mode, through_cells, through_shells
from validation.paper.times import rendered

LAYERS = (40, 80)
NORMALS = ("gradient", "facet")
RESOLUTION = (306, 256)
OBLIQUE = (60.0, -190.0, 110.0)
FROM_ABOVE = (60.0, -90.0, 190.0)
MIDDLE_MM = 80.0
"""Half the cylinder's length, less what lies about its ends."""
SHIFT_MM = 4.0
TOP_MM = 25.0
INSIDE_MM = 0.05
"""Depth in the part that a shell must reach to cut it; the part's own facets lie 0.02 mm deep."""

MEDIAN_BOUND = {"gradient": 8.0, "facet": 15.0}
P95_BOUND = {"gradient": 15.0, "facet": 20.0}
MISCOUNTED_BOUND = 3.0
"""Per cent."""

FloatArray = NDArray[np.float64]


@frozen(eq=False)
class Trouble:
    """A field and a part that shells have trouble with.

    Attributes
    ----------
    name : str
    field : IndexField
    scene : Scene
        Its air is replaced by the field's shells or cells.
    shift_mm : float
        How far the part was moved down in the field.
    whole : IndexField or None
        The field before a piece of it was cut off.
    """

    name: str
    field: IndexField
    scene: Scene
    shift_mm: float = 0.0
    whole: IndexField | None = None


@frozen(eq=False)
class Outcome:
    """One picture: its hits, the rays by their end, and which of them do not add up (status 5)."""

    hits: Hits
    rays: RayCounts
    mismatched: NDArray[np.bool_]

    @property
    def unaccounted(self) -> int:
        """Rays that were launched and have no status."""
        return self.rays.launched - sum(self.rays.of(status) for status in Status)

    @property
    def miscounted(self) -> int:
        """Hits that gave up, or whose index steps do not add up."""
        return self.rays.gave_up + self.rays.index_mismatch


def troubles() -> list[Trouble]:
    """The bundled field, the coarsest of the cylinder's, as it is and made worse."""
    folder = folder_of("cylinder")
    field, part = read_field(folder / "field.vtu"), read_part(folder / "part.ply")
    shift = np.eye(4)
    shift[2, 3] = -SHIFT_MM

    def view(origin: tuple[float, float, float], part: Any = part) -> Scene:
        camera = camera_at(origin, sensor_mm=(6.7, 5.6), resolution=RESOLUTION)
        return Scene(part, HotAir(field), camera, variant=ensure())

    return [
        Trouble("coarse field", field, view(OBLIQUE)),
        Trouble(
            f"part {SHIFT_MM:g} mm too low",
            field,
            view(OBLIQUE, part.transformed(shift)),
            shift_mm=SHIFT_MM,
        ),
        Trouble(
            f"data cut off {TOP_MM:g} mm above the axis",
            cropped(field, lambda centres: centres[:, 2] < TOP_MM),
            view(FROM_ABOVE),
            whole=field,
        ),
    ]


def cropped(field: IndexField, kept: Callable[[FloatArray], NDArray[np.bool_]]) -> IndexField:
    """The cells of a field whose centres are kept."""
    grid = field.grid.copy()
    grid.clear_data()
    grid.point_data["n - 1"] = field.refractivity
    cells = grid.extract_cells(np.flatnonzero(kept(np.asarray(grid.cell_centers().points))))
    values = np.asarray(cells.point_data["n - 1"], dtype=np.float64)
    return evolve(field, grid=cells, refractivity=values)


def outcome(scene: Scene) -> Outcome:
    """Render a scene."""
    rendering = rendered(scene)
    image = rendering.image
    mismatched = image.status.ravel() == Status.INDEX_MISMATCH
    return Outcome(hits_of(image), rendering.metrics.rays, mismatched)


def of_cells(trouble: Trouble, normals: str) -> Outcome:
    """The cells engine's picture, with the gradient to which such normals converge."""
    return outcome(through_cells(trouble.scene, trouble.field, normals))


def of_shells(trouble: Trouble, stack: ShellStack, normals: str) -> Outcome:
    """The same through shells."""
    return outcome(through_shells(trouble.scene, stack, Mode(normals, normals=normals)))


def cutting_pairs(stack: ShellStack) -> int:
    """Pairs of neighbouring shells whose triangles cut each other."""
    surfaces = [polydata(shell.vertices, shell.faces) for shell in stack.shells]
    return sum(outer.collision(inner, contact_mode=1)[1] > 0 for outer, inner in pairwise(surfaces))


def cut_by(stack: ShellStack, shift_mm: float) -> int:
    """Shells that reach into the cylinder, its ends left out."""
    count = 0
    for shell in stack.shells:
        x, y, z = shell.vertices.T
        radius = np.hypot(y, z + shift_mm)[np.abs(x) < MIDDLE_MM]
        count += bool((radius < CYLINDER_RADIUS_MM - INSIDE_MM).any())
    return count


def shares(here: Outcome, reference: Outcome) -> tuple[Differences, float, float]:
    """Differences; their median and p95 over those of the reference's displacements, per cent."""
    found, size = compare(here.hits, reference.hits), displacement_statistics(reference.hits)
    return (
        found,
        100 * found.median / size["displacement_median"],
        100 * found.p95 / size["displacement_p95"],
    )


def ledger(case: str, found: Outcome) -> list[Line]:
    """Every ray has an end, and how many of the hits do not add up."""
    counts = {status.key: found.rays.of(status) for status in Status}
    counts["open_boundary"] = found.rays.open_boundary or 0
    ending = ", ".join(f"{count:,} {key}" for key, count in counts.items() if count)
    share = 100 * found.miscounted / found.rays.hit
    return [
        Line(
            f"{case}: rays without a status",
            f"{found.rays.launched:,} launched",
            ending,
            found.unaccounted,
            0,
            "rays",
        ),
        Line(
            f"{case}: hits given up, or with index steps that do not add up",
            "0",
            f"{found.miscounted} of {found.rays.hit:,}",
            share,
            MISCOUNTED_BOUND,
        ),
    ]


def refused(case: str, here: Outcome, reference: Outcome) -> list[Line]:
    """Errors of the hits whose index steps do not add up, which metrics leave out."""
    chosen = here.mismatched & reference.hits.good
    if not chosen.any():
        return []
    off = compare(evolve(here.hits, good=chosen), reference.hits)
    size = displacement_statistics(evolve(reference.hits, good=chosen))
    return [
        Line(
            f"{case}: difference of those hits, median",
            "",
            f"{100 * off.median / size['displacement_median']:.2f} %",
        )
    ]


def agreement(case: str, here: Outcome, reference: Outcome, normals: str) -> list[Line]:
    """Distance of shells from the cells engine."""
    found, median, p95 = shares(here, reference)
    unmatched = found.only_here + found.only_reference
    return [
        Line(f"{case}: median", "0", f"{median:.2f} %", median, MEDIAN_BOUND[normals]),
        Line(f"{case}: p95", "0", f"{p95:.2f} %", p95, P95_BOUND[normals]),
        Line(
            f"{case}: rays good in one of the pictures only",
            "0",
            f"{unmatched} of {found.matched + unmatched:,}",
        ),
    ]


def lines_of(
    trouble: Trouble, layers: Sequence[int] = LAYERS, normals: Sequence[str] = NORMALS
) -> list[Line]:
    """All figures of one case."""
    references = {name: of_cells(trouble, name) for name in normals}
    lines = ledger(f"{trouble.name}, cells engine", references[normals[0]])
    if trouble.whole is not None:
        lines += before_the_cut(trouble, trouble.whole, layers[-1], references[normals[0]])
    for count in layers:
        stack = contour_shells(trouble.field, count)
        case = f"{trouble.name}, {count} shells"
        if trouble.shift_mm:
            lines.append(
                Line(f"{case}: shells that cut the part", "", str(cut_by(stack, trouble.shift_mm)))
            )
        for name in normals:
            found = of_shells(trouble, stack, name)
            if name == normals[0]:
                lines += [*ledger(case, found), *refused(case, found, references[name])]
            lines += agreement(f"{case}, {name} normals", found, references[name], name)
    return lines


def before_the_cut(trouble: Trouble, whole: IndexField, layers: int, cut: Outcome) -> list[Line]:
    """Effect of missing air, and distance of shells where none is missing."""
    before = evolve(trouble, name="the same view of the whole data", field=whole, whole=None)
    reference = of_cells(before, "gradient")
    _, median, p95 = shares(cut, reference)
    found = of_shells(before, contour_shells(whole, layers), "gradient")
    return [
        Line(f"{trouble.name}, cells engine, to the whole data: {name}", "", f"{value:.1f} %")
        for name, value in (("median", median), ("p95", p95))
    ] + agreement(f"{before.name}, {layers} shells, gradient normals", found, reference, "gradient")


def overlap(field: IndexField) -> list[Line]:
    """Neighbours that cut each other."""
    lines = []
    for count in LAYERS:
        stack = contour_shells(field, count)
        lines.append(
            Line(
                f"coarse field, {count} shells: neighbours that cut each other",
                "",
                f"{cutting_pairs(stack)} of {len(stack.shells) - 1} pairs",
            )
        )
    return lines


def _lines(_: Path) -> list[Line]:
    cases = troubles()
    return [*overlap(cases[0].field), *(line for case in cases for line in lines_of(case))]


SECTION = Section(
    "trouble",
    "Where shells have trouble",
    "Cases made on purpose, with 40 and 80 shells against the cells engine through the same "
    "field. A coarse field (the bundled one: cells of 1.9 mm at the wall), where several surfaces "
    "pass each cell and cut each other. The same with the part 4 mm too low in it, so that half of "
    "the shells cut its underside and a gap opens above. The same, cut off "
    "25 mm above the axis, so that shells are open where the plume leaves, and seen through that "
    "opening; what the missing air itself changes is much more. Difference of "
    "the hits over the displacement, median by median and p95 by p95; gradient normals are "
    "compared with the recovered gradient, facet normals with the constant one.",
    _lines,
)

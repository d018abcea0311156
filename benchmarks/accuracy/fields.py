"""Thirteen shells against the continuous engine in all real fields of the tree."""

from __future__ import annotations

from pathlib import Path

from benchmarks.accuracy.agreement import FIELD, MEDIAN_BOUND, P95_BOUND
from benchmarks.accuracy.line import Line, Section
from benchmarks.component_fields import SOLVED, component_field
from benchmarks.engines import VIEWS
from benchmarks.real_fields import Agreement, Position, agreements
from iriftrace.field import read_field
from iriftrace.index_field import IndexField
from iriftrace.part import read_part
from iriftrace.scenes import folder_of
from iriftrace.scenes.components import COMPONENTS

CYLINDER_MM = VIEWS["corner"]
THROUGH_THE_PLUME = {
    f"from {', '.join(f'{x:g}' for x in VIEWS[name])} mm": VIEWS[name]
    for name in ("corner", "45 degrees above", "oblique")
}
"""Views of the wishbone in which rays pass the plume of one arm on their way to another."""

OWN = "the scene's own pose"


def cases(folder: Path) -> dict[str, tuple[IndexField, str, dict[str, Position]]]:
    """For each field its name, the field, its scene and the views."""
    cylinders = {
        "bundled cylinder": folder_of("cylinder") / "field.vtu",
        "cylinder, finer flow solution": FIELD,
    }
    found = {
        name: (read_field(path), "cylinder", {OWN: CYLINDER_MM}) for name, path in cylinders.items()
    }
    for scene in SOLVED:
        views = {OWN: COMPONENTS[scene].origin_mm}
        if scene == "wishbone":
            views |= THROUGH_THE_PLUME
        found[scene.replace("_", " ")] = component_field(scene, folder), scene, views
    return found


def _lines(folder: Path) -> list[Line]:
    lines = []
    for name, (field, scene, views) in cases(folder).items():
        part = read_part(folder_of(scene) / "part.ply")
        results = agreements(folder / scene, field, part, list(views.values()))
        for view, found in zip(views, results, strict=True):
            lines += lines_of(f"{name}, {view}", found, bounded=view == OWN)
    return lines


def lines_of(case: str, found: Agreement, bounded: bool) -> list[Line]:
    """Rows of one view."""
    bounds = (MEDIAN_BOUND, P95_BOUND) if bounded else (None, None)
    size = " and ".join(f"{um:.3g}" for um in found.displacement_um)
    other = " and ".join(f"{share:.1f} %" for share in found.constant)
    return [
        Line(f"{case}: {found.rays:,} rays, displacement, median and p95", "", f"{size} µm"),
        *(
            Line(f"{case}: 13 shells, {what}", "0", f"{share:.2f} %", share, bound)
            for what, share, bound in zip(("median", "p95"), found.shells, bounds, strict=True)
        ),
        Line(f"{case}: constant gradient in each cell, median and p95", "", other),
    ]


SECTION = Section(
    "fields",
    "Thirteen shells in every field",
    "The same difference for the fields of all bundled scenes, with all triangles of their shells: "
    "13 at equal steps, with gradient normals, against the continuous engine with the recovered "
    "gradient. In the wishbone's last three views rays cross the plume of one arm on their way to "
    "another and are turned there and back, so that little is left of much; besides, shells do not "
    "see the air beside the outermost one. 40 shells halve the difference "
    "(`python -m benchmarks.engines`); the continuous engine needs none. What the engine makes of "
    "a gradient that is constant in each cell tells what the mesh leaves open.",
    _lines,
)

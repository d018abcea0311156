"""Places of the shells: equal steps of the index, the default, against graded ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from attrs import evolve

from iriftrace.core.runtime.variant import ensure
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.medium.shells.levels import RULES
from iriftrace.scenes import folder_of
from iriftrace.scenes.closed_forms import CYLINDER_UM
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene
from validation.line import Line, Section
from validation.paper.differences import Hits
from validation.paper.mode import OURS, through_shells
from validation.paper.study import picture
from validation.sections.exact_shells import cylinder_hits, displacements_um

USUAL_SHELLS, FINEST = 13, 80
TRIMMED = 0.001
TRIMMED_MEAN = "mean (without the largest 0.1 %)"
"""One ray that jumps from one side of a silhouette to the other changes the mean by per cents."""

REAL_RULES = ("rim", "midpoint", "graded")
MEAN_BOUND = 2.0
"""Per cent, of the default rule with the default number of shells."""


def in_the_cylinder(folder: Path) -> list[Line]:
    """Errors of 13 shells where the air ends somewhere."""
    lines = []
    for rule in RULES:
        hits = cylinder_hits(folder / rule, USUAL_SHELLS, rule, "layers")
        found = displacements_um(hits)
        lines += [
            Line(
                f"hot cylinder, {USUAL_SHELLS} shells, {rule} rule, ray at {b:g} R: displacement",
                f"{exact:.7g} µm",
                f"{um:.7g} µm",
                100 * (um / exact - 1),
            )
            for (b, exact), um in zip(CYLINDER_UM.items(), found.tolist(), strict=True)
        ]
    return lines


def in_real_air() -> list[Line]:
    """Mean and median of the bundled pose with 13 shells, against 160."""
    folder = folder_of("cylinder")
    field = read_field(folder / "field.vtu")
    camera = load_scene(folder_of("cylinder_paper") / "scene.xml", {"scale": 0.25}).camera
    part = read_part(folder / "part.ply")
    scene = Scene(part, HotAir(field), camera, variant=ensure())
    lines = []
    for rule in REAL_RULES:
        mode = evolve(OURS, name=rule, index_rule=rule)
        sizes = [
            _statistics(
                picture(through_shells(scene, contour_shells(field, count, rule=rule), mode))
            )
            for count in (USUAL_SHELLS, FINEST)
        ]
        for name in sizes[0]:
            usual, finest = (size[name] for size in sizes)
            error = 100 * (usual / finest - 1)
            bounded = name == TRIMMED_MEAN and rule == OURS.index_rule
            lines.append(
                Line(
                    f"bundled pose, {USUAL_SHELLS} shells, {rule} rule, against {FINEST}: "
                    f"displacement, {name}",
                    f"{1e3 * finest:.4f} µm",
                    f"{1e3 * usual:.4f} µm",
                    error,
                    MEAN_BOUND if bounded else None,
                )
            )
    return lines


def _statistics(hits: Hits) -> dict[str, float]:
    """Statistics of the displacements, mm."""
    norm = np.sort(np.linalg.norm(hits.displacement[hits.good], axis=1))
    return {
        TRIMMED_MEAN: float(norm[: int((1 - TRIMMED) * len(norm))].mean()),
        "median": float(np.median(norm)),
        "p95": float(np.quantile(norm, 0.95)),
    }


def _lines(folder: Path) -> list[Line]:
    return [*in_the_cylinder(folder), *in_real_air()]


SECTION = Section(
    "steps",
    "Where the shells lie",
    "Equal steps of the index with a thin one outside (rim), the default, against equal steps "
    "(midpoint), graded ones, which are 0.3 times as "
    "large at both ends, and against shells that lie at the layer's own index (outer): 13 shells "
    "each, on the exact hot cylinder and on the bundled pose, there against 80 shells of the same "
    "rule. With rays bent all along the layers it hardly matters; with rays bent at the shells "
    "alone (`-D bending=shells`), as with the outer rule always, what the innermost layer does to "
    "rays that graze the wall, and the outermost one to all, makes most of the error.",
    _lines,
)

"""The bevel gear and one of its teeth."""

from __future__ import annotations

import numpy as np

from iriftrace.planning.criteria import Criteria
from iriftrace.planning.rank import rank_poses
from scenes.generators.bevel_gear import TOOTH, bevel_gear
from scenes.generators.components import TOOTH_NUMBER, tooth_centre
from validation.statements.finding import Finding, verdict
from validation.statements.orbit import BoolArray, FloatArray, Swept

STEEP_DEG, OBLIQUE_DEG = 30.0, 60.0
"""Angles of incidence below and above which a face is seen frontally and obliquely."""

AXIAL_DEG, FRONTAL_DEG = 20.0, 30.0


def findings(swept: Swept) -> list[Finding]:
    """The two statements about the whole gear."""
    return [_oblique(swept), _largest_region(swept), _axial(swept)]


def _oblique(swept: Swept) -> Finding:
    teeth = swept.region("teeth")
    holds, figures = [], []
    everything = np.ones(len(swept.towards), dtype=bool)
    for poses, name in ((everything, "all poses"), (swept.beside_plume, "below 45° elevation")):
        frontal = swept.on_faces_um(teeth, poses, (0.0, STEEP_DEG))
        oblique = swept.on_faces_um(teeth, poses, (OBLIQUE_DEG, 90.0))
        holds.append(oblique > frontal)
        figures.append(
            f"{name}: {oblique:.2f} µm beyond {OBLIQUE_DEG:g}° incidence, {frontal:.2f} µm below "
            f"{STEEP_DEG:g}°"
        )
    return Finding(
        "largest displacement at oblique views on the teeth", verdict(*holds), "; ".join(figures)
    )


def _largest_region(swept: Swept) -> Finding:
    poses = swept.beside_plume
    values = {
        name: swept.on_faces_um(swept.region(name), poses) for name in swept.part.region_names
    }
    largest = max(values, key=lambda name: values[name])
    listed = ", ".join(f"{name} {value:.2f}" for name, value in values.items())
    return Finding(
        "and on the teeth rather than elsewhere",
        "yes" if largest == "teeth" else f"no, {largest}",
        f"below 45° elevation, µm: {listed}",
    )


def _axial(swept: Swept) -> Finding:
    seen = swept.median_um()
    angles = {side: swept.angle_to((0, 0, z)) for side, z in (("above", 1.0), ("below", -1.0))}
    axial = {side: float(seen[int(np.argmin(angle))]) for side, angle in angles.items()}
    best = int(np.nanargmin(seen))
    off = min(float(angle[best]) for angle in angles.values())
    figures = (
        f"smallest median of {np.isfinite(seen).sum()} poses {seen[best]:.2f} µm, {off:.0f}° from "
        f"the axis; along the axis {axial['below']:.2f} µm from below and {axial['above']:.1f} µm "
        f"from above, down through the plume; median of all poses {np.nanmedian(seen):.2f} µm"
    )
    return Finding("smallest along the axis", "yes" if off < AXIAL_DEG else "no", figures)


def target() -> FloatArray:
    """(3,) array, mm: the middle of the tooth."""
    return tooth_centre(bevel_gear(tooth=TOOTH_NUMBER))


def tooth_findings(swept: Swept) -> list[Finding]:
    """The statement about one tooth."""
    part = swept.part
    own: BoolArray = swept.region(TOOTH)
    front = np.average(part.face_normals[own], axis=0, weights=part.face_areas[own])
    angle = swept.angle_to(front)
    holds, figures = [], []
    for statistic in ("mean", "median"):
        plan = rank_poses(swept.dataset, Criteria(region=TOOTH, statistic=statistic))
        best = plan.best
        holds.append(bool(angle[best] < FRONTAL_DEG))
        near = np.argsort(angle)[:1]
        rank = int(np.flatnonzero(np.isin(plan.order, near))[0]) + 1
        figures.append(
            f"{statistic}: best pose {angle[best]:.0f}° from the tooth's normal (azimuth "
            f"{float(swept.dataset['azimuth'][best]):g}°, elevation "
            f"{float(swept.dataset['elevation'][best]):g}°, displacement "
            f"{1e3 * plan.metrics['displacement'][best]:.2f} µm); the most frontal pose, "
            f"{angle[near[0]]:.0f}°, has rank {rank} of {len(plan.order)}"
        )
    return [
        Finding(
            "the combined metric picks a frontal pose",
            "yes" if all(holds) else ("depends on the statistic" if any(holds) else "no"),
            "; ".join(figures),
        )
    ]

"""The hybrid cylinder: a cold and a hot half."""

from __future__ import annotations

import numpy as np

from validation.statements.finding import Finding
from validation.statements.orbit import Swept

EDGE_MM = 15.0
"""Lateral faces this near to a head are the transition to it."""

BAND_MM = 10.0
"""Width of the bands along the axis that are compared."""

AXIAL_DEG = 20.0
OBLIQUE_DEG = (30.0, 60.0)
"""Angles from the axis of horizontal views that see head and lateral surface."""


def findings(swept: Swept) -> list[Finding]:
    """The three statements."""
    return [_interface(swept), _edges(swept), _axial(swept)]


def _interface(swept: Swept) -> Finding:
    along = swept.part.face_centres[:, 0]
    lateral = swept.region("lateral -x", "transition", "lateral +x")
    halves = {
        "transition": swept.region("transition"),
        "cold": (along < 0.0) & swept.region("lateral -x"),
        "hot": (along > 0.0) & swept.region("lateral +x"),
    }
    from_axis = swept.angle_to((1, 0, 0))
    low, high = OBLIQUE_DEG
    level = np.abs(swept.elevation_deg) < 1.0
    selections = {
        "below 45° elevation": swept.beside_plume,
        "oblique and horizontal": level
        & (np.minimum(from_axis, 180.0 - from_axis) > low)
        & (np.minimum(from_axis, 180.0 - from_axis) < high),
    }
    holds, figures = [], []
    for name, poses in selections.items():
        values = {key: swept.on_faces_um(faces, poses) for key, faces in halves.items()}
        starts = np.arange(-80.0, 80.0, BAND_MM)
        bands = [
            swept.on_faces_um(lateral & (along >= start) & (along < start + BAND_MM), poses)
            for start in starts
        ]
        peak = float(starts[int(np.argmax(bands))]) + 0.5 * BAND_MM
        holds.append(values["transition"] > max(values["cold"], values["hot"]))
        figures.append(
            f"{name}: {values['transition']:.2f} µm on the transition, {values['cold']:.2f} cold, "
            f"{values['hot']:.2f} hot half; largest ({max(bands):.2f}) in the band at "
            f"x = {peak:+.0f} mm, smallest ({min(bands):.2f})"
        )
    only_oblique = "yes at oblique horizontal views, else a step from the cold to the hot half"
    answer = "yes" if all(holds) else (only_oblique if holds[1] else "no")
    return Finding("largest displacement along the material interface", answer, "; ".join(figures))


def _edges(swept: Swept) -> Finding:
    along = swept.part.face_centres[:, 0]
    to_head = swept.part.bounds[1, 0] - np.abs(along)
    holds, heads, figures = [], [], []
    for half, region, side in (("cold", "lateral -x", -1.0), ("hot", "lateral +x", 1.0)):
        own = swept.region(region)
        near = swept.on_faces_um(own & (to_head < EDGE_MM), swept.beside_plume)
        far = swept.on_faces_um(own & (to_head >= EDGE_MM), swept.beside_plume)
        head = swept.on_faces_um(swept.region(f"head {'-+'[side > 0]}x"), swept.beside_plume)
        holds.append(near > far)
        heads.append(head > near)
        figures.append(
            f"{half}: {near:.2f} µm within {EDGE_MM:g} mm of the head, {far:.2f} farther away, "
            f"{head:.2f} on the head"
        )
    answer = "yes" if all(holds) else ("at one end" if any(holds) else "no")
    if all(holds) and any(heads):
        answer = "yes on the lateral surface, but the heads themselves have more"
    return Finding(
        "and along the transition from head to lateral surface",
        answer,
        "below 45° elevation, " + "; ".join(figures),
    )


def _axial(swept: Swept) -> Finding:
    seen = swept.median_um()
    angle = np.minimum(swept.angle_to((1, 0, 0)), swept.angle_to((-1, 0, 0)))
    best = int(np.nanargmin(seen))
    cold, hot = (float(seen[int(np.argmin(swept.angle_to((side, 0, 0))))]) for side in (-1.0, 1.0))
    return Finding(
        "smallest axially",
        "yes" if angle[best] < AXIAL_DEG else "no",
        f"smallest median of {np.isfinite(seen).sum()} poses {seen[best]:.2f} µm, "
        f"{angle[best]:.0f}° from the axis; at the cold head {cold:.2f}, at the hot head "
        f"{hot:.2f} µm; median of all poses {np.nanmedian(seen):.2f} µm",
    )

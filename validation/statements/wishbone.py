"""The wishbone."""

from __future__ import annotations

import numpy as np

from iriftrace.core.mesh.topology import find_neighbours, weld
from iriftrace.part.part import Part
from validation.statements.finding import Finding, verdict
from validation.statements.orbit import FloatArray, Swept

AXIAL_DEG = 20.0
AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def findings(swept: Swept) -> list[Finding]:
    """The two statements."""
    return [_curved(swept), _axial(swept)]


def curvature(part: Part) -> FloatArray:
    """(m,) array, 1/mm: largest turn of the normal to a neighbour over the distance across it.

    The distance is that between the triangles' centres, square to their edge.
    """
    neighbours = find_neighbours(weld(part.vertices)[part.faces])
    one, two = neighbours.pairs.T
    side = neighbours.edges[:, 0]
    start = part.vertices[part.faces[one, side]]
    edge = np.linalg.norm(part.vertices[part.faces[one, (side + 1) % 3]] - start, axis=1)
    cosine = np.einsum("ij,ij->i", part.face_normals[one], part.face_normals[two])
    # A centre lies a third of its triangle's height away from the edge.
    way = 2.0 / 3.0 * (part.face_areas[one] + part.face_areas[two]) / edge
    turn = np.arccos(np.clip(cosine, -1.0, 1.0)) / way
    largest = np.zeros(len(part.faces))
    np.maximum.at(largest, one, turn)
    np.maximum.at(largest, two, turn)
    return largest


def _curved(swept: Swept) -> Finding:
    bent = curvature(swept.part)
    low, high = np.quantile(bent, (0.25, 0.75))
    holds, figures = [], []
    everything = np.ones(len(swept.towards), dtype=bool)
    for poses, name in ((everything, "all poses"), (swept.beside_plume, "below 45° elevation")):
        curved = swept.on_faces_um(bent >= high, poses)
        flat = swept.on_faces_um(bent <= low, poses)
        holds.append(curved > flat)
        figures.append(
            f"{name}: {curved:.2f} µm on the most curved quarter of the faces (radius below "
            f"{1 / high:.1f} mm), {flat:.2f} µm on the flattest (above {1 / low:.0f} mm)"
        )
    regions = ", ".join(
        f"{name} {swept.on_faces_um(swept.region(name), swept.beside_plume):.2f}"
        for name in swept.part.region_names
    )
    figures.append(f"by region, below 45° elevation, µm: {regions}")
    return Finding("largest displacement at curved regions", verdict(*holds), "; ".join(figures))


def _axial(swept: Swept) -> Finding:
    seen = swept.median_um()
    best = int(np.nanargmin(seen))
    from_axis = {
        name: np.minimum(swept.angle_to(axis), 180.0 - swept.angle_to(axis))
        for name, axis in AXES.items()
    }
    near = min(AXES, key=lambda name: from_axis[name][best])
    near_axis = {name: seen[angle < AXIAL_DEG] for name, angle in from_axis.items()}
    listed = ", ".join(
        f"{name} {np.nanmin(values):.2f} to {np.nanmax(values):.2f}"
        for name, values in near_axis.items()
    )
    is_axial = from_axis[near][best] < AXIAL_DEG
    where = "from below" if swept.towards[best, 2] < 0 else "from above"
    return Finding(
        "smallest along the component's axis",
        f"yes, along {near}, {where}" if is_axial else "no",
        f"smallest median {seen[best]:.2f} µm, {from_axis[near][best]:.0f}° from {near}; within "
        f"{AXIAL_DEG:g}° of the axes, µm: {listed}; median of all poses "
        f"{np.nanmedian(seen):.2f} µm",
    )

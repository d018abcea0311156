"""The shells engine against media whose rays are known in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from iriftrace.plugins.first_hit import BENDING
from iriftrace.scenes.analytic import concentric_cylinders, slab
from iriftrace.scenes.closed_forms import CYLINDER_UM, RADIUS_MM, SLAB_SHIFT_UM
from iriftrace.scenes.qualification import cylinder_rays, slab_rays
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import RayHits, trace_rays
from iriftrace.tracing.write import write_scene
from validation.curves import draw_convergence
from validation.inputs.cameras import camera_at
from validation.inputs.parts import cylinder_fine_at
from validation.line import Line, Section, relative
from validation.oracles.exact_layers import RoundAir

FloatArray = NDArray[np.float64]

RULE_OF = {"layers": "rim", "shells": "midpoint"}
"""Rule of the shells by where rays are bent: the default, and the paper's equal steps."""

LAST_WITH_ORDER = 0.95
"""Height up to which errors of one sign fall with the number of shells."""

CYLINDER_BOUND = {
    "layers": {13: 0.1, 26: 0.05, 100: 0.05},
    "shells": {13: 0.7, 26: 0.3, 100: 0.05},
}
ORDER_LAYERS = (13, 26)
DRAWN_LAYERS = (7, 13, 26, 50, 100, 200)
LENGTH_MM = 60.0
PICTURE = "exact.png"
ANY_CAMERA = camera_at((0.0, -200.0, 150.0), sensor_mm=(6.7, 5.6), resolution=(8, 8))


def slab_hits(folder: Path) -> dict[str, RayHits]:
    """Hits of the rays of ``SLAB_SHIFT_UM``, in the x-z plane, by where 200 plane layers bend."""
    part, shells = slab(200, air=RoundAir(), size_mm=1000.0)
    xml = write_scene(folder, part, shells, ANY_CAMERA, paraview=False)
    rays = slab_rays()
    return {
        way: trace_rays(
            load_scene(xml, {"bending": way}, engine="shells"), rays.origin, rays.direction
        )
        for way in BENDING
    }


def usual_hits(folder: Path, layers: int) -> dict[str, RayHits]:
    """Hits behind the cylinder's layers by where these bend, the shells by ``RULE_OF`` each way."""
    return {way: cylinder_hits(folder / way, layers, rule, way) for way, rule in RULE_OF.items()}


def cylinder_hits(folder: Path, layers: int, rule: str, bending: str) -> RayHits:
    """Hits of the rays of ``CYLINDER_UM`` behind coaxial layers.

    The shells have 4,000 facets, the part as if it had 36,000, which leave 0.003 % at most to these
    rays; from 20,000 to 48,000 its vertices' rounding to single precision leaves up to 0.03 %.
    """
    _, shells = concentric_cylinders(
        layers, air=RoundAir(), sections=4000, part_sections=12, length_mm=LENGTH_MM, rule=rule
    )
    if rule == "outer":
        # The last shell is the wall itself; a ray ends there before it is bent.
        shells = evolve(shells, shells=shells.shells[:-1])
    heights = np.array(list(CYLINDER_UM))
    part = cylinder_fine_at(180.0 - np.degrees(np.arcsin(heights)), RADIUS_MM, LENGTH_MM)
    xml = write_scene(folder, part, shells, ANY_CAMERA, paraview=False)
    rays = cylinder_rays()
    scene = load_scene(xml, {"bending": bending}, engine="shells")
    return trace_rays(scene, rays.origin, rays.direction)


def displacements_um(hits: RayHits) -> FloatArray:
    """Lengths of the displacements."""
    return np.linalg.norm(hits.displacement, axis=1) * 1e3


def _lines(folder: Path) -> list[Line]:
    hits = {n: usual_hits(folder / f"cylinder_{n}", n) for n in DRAWN_LAYERS}
    found = {
        way: {n: displacements_um(by_way[way]) for n, by_way in hits.items()} for way in BENDING
    }
    exact = np.array(list(CYLINDER_UM.values()))
    panels = {
        f"bending={way}": {
            f"ray at {b:g} R": (
                DRAWN_LAYERS,
                [float(abs(100 * (um[layers] / exact - 1)[place])) for layers in DRAWN_LAYERS],
            )
            for place, b in enumerate(CYLINDER_UM)
        }
        for way, um in found.items()
    }
    draw_convergence(
        folder / PICTURE, panels, "number of shells", "error of the displacement / %", 2
    )
    lines = []
    for way, shifted in slab_hits(folder / "slab").items():
        lines += _of_the_slab(way, shifted)
        lines += _of_the_cylinder(way, found[way])
    return lines


def _of_the_slab(bending: str, hits: RayHits) -> list[Line]:
    return [
        relative(
            f"slab, 200 shells, bending={bending}, {angle}°: shift", exact, um, "µm", bound=0.01
        )
        for (angle, exact), um in zip(
            SLAB_SHIFT_UM.items(), (1e3 * hits.displacement[:, 0]).tolist(), strict=True
        )
    ]


def _of_the_cylinder(bending: str, found: dict[int, FloatArray]) -> list[Line]:
    lines = []
    for layers, bound in CYLINDER_BOUND[bending].items():
        lines += [
            relative(
                f"hot cylinder, {layers} shells, bending={bending}, ray at {b:g} R: displacement",
                exact,
                um,
                "µm",
                bound,
            )
            for (b, exact), um in zip(CYLINDER_UM.items(), found[layers].tolist(), strict=True)
        ]
    for place, b in enumerate(CYLINDER_UM):
        # In layers the part's facets are what is left.
        if b > LAST_WITH_ORDER or bending == "layers":
            continue
        few, more = (abs(found[layers][place] / CYLINDER_UM[b] - 1) for layers in ORDER_LAYERS)
        order = np.log(few / more) / np.log(ORDER_LAYERS[1] / ORDER_LAYERS[0])
        what = f"order from {ORDER_LAYERS[0]} to {ORDER_LAYERS[1]} shells, bending={bending}"
        lines.append(Line(f"{what}, ray at {b:g} R", "2", f"{order:.2f}"))
    return lines


SECTION = Section(
    "exact",
    "Shells against exact solutions",
    "A slab of 20 mm whose temperature falls linearly from 1100 °C to 20 °C (n sin θ is constant "
    "in plane layers), and a hot cylinder of 13.5 mm radius in air whose temperature falls with "
    "the logarithm of the radius (n r sin θ is constant, Bouguer). n - 1 = 2.718e-4 at 20 °C. What "
    "is expected comes from quadrature (`scenes/closed_forms.py`). Rays "
    "are bent all along the layers, with a thin one outside (the default), or at the shells alone "
    "(`-D bending=shells`), with equal steps. Second order is "
    "reached later near the silhouette, where the path through the layers has a root of the "
    "distance from the wall in it; at 0.999 R errors of both signs meet. What stays of "
    "0.003 % and less is what the part's facets leave: from 26 shells on nearly all, where rays "
    "are bent in the layers.",
    _lines,
    picture=PICTURE,
    minutes=1.0,
)

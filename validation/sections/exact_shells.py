"""The shells engine against media whose rays are known in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from iriftrace.air.refractivity import Air
from iriftrace.camera.camera import Camera
from iriftrace.camera.pose import look_at
from iriftrace.plugins.first_hit import BENDING
from iriftrace.scene.load import load_scene
from iriftrace.scene.write import write_scene
from iriftrace.scenes.analytic import CYLINDER_RADIUS_MM, concentric_cylinders, slab
from iriftrace.trace.render import RayHits, trace_rays
from validation.curves import draw_convergence
from validation.line import Line, Section, relative

FloatArray = NDArray[np.float64]

SLAB_SHIFT_UM = {15: 0.906732, 60: 21.891213, 85: 4921.029686}
"""Lateral shift of a ray at these angles of incidence, degrees."""

CYLINDER_UM = {0.25: 0.484096, 0.75: 2.430121, 0.95: 7.621401, 0.999: 67.019772}
"""Displacement of parallel rays at these heights over the axis, in radii."""

LAST_WITH_ORDER = 0.95
"""Height up to which errors of one sign fall with the number of shells."""

CYLINDER_BOUND = {13: 0.7, 26: 0.3, 100: 0.05}
ORDER_LAYERS = (13, 26)
DRAWN_LAYERS = (7, 13, 26, 50, 100, 200)
PICTURE = "exact.png"
ANY_CAMERA = Camera(
    focal_length_mm=10.0,
    sensor_mm=(6.7, 5.6),
    resolution=(8, 8),
    matrix=look_at((0.0, -200.0, 150.0), (0.0, 0.0, 0.0)),
)


class RoundAir(Air):
    """Air of exactly the refractivity for which the expected values were computed."""

    @property
    def ambient_refractivity(self) -> float:
        return 2.718e-4


def slab_hits(folder: Path, angle_deg: float, bending: str) -> RayHits:
    """Hit of one ray in the x-z plane behind 200 plane layers."""
    part, shells = slab(200, air=RoundAir(), size_mm=1000.0)
    xml = write_scene(folder, part, shells, ANY_CAMERA, paraview=False)
    scene = load_scene(xml, {"bending": bending})
    angle = np.radians(angle_deg)
    direction = np.array((np.sin(angle), 0.0, -np.cos(angle)))
    start = np.array((1.0, 2.0, 0.0)) - direction * 25 / np.cos(angle)
    return trace_rays(scene, [start], [direction])


def cylinder_hits(
    folder: Path, layers: int, rule: str = "midpoint", bending: str = "layers"
) -> RayHits:
    """Hits of the rays of ``CYLINDER_UM`` behind coaxial layers of 4,000 facets.

    The part has 36,000, whose facets leave 0.003 % at most to these rays; with 20,000 to 48,000 the
    vertices' rounding to single precision leaves up to 0.03 %.
    """
    part, shells = concentric_cylinders(
        layers, air=RoundAir(), sections=4000, part_sections=36_000, rule=rule
    )
    if rule == "outer":
        # The last shell is the wall itself; a ray ends there before it is bent.
        shells = evolve(shells, shells=shells.shells[:-1])
    xml = write_scene(folder, part, shells, ANY_CAMERA, paraview=False)
    scene = load_scene(xml, {"bending": bending})
    heights = np.array(list(CYLINDER_UM)) * CYLINDER_RADIUS_MM
    origins = np.column_stack((np.full_like(heights, 0.123), np.full_like(heights, -100), heights))
    return trace_rays(scene, origins, np.tile((0.0, 1.0, 0.0), (len(heights), 1)))


def _lines(folder: Path) -> list[Line]:
    found = {way: _displacements_um(folder / way, way) for way in BENDING}
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
    return [line for way in BENDING for line in _of_one_way(folder / way, way, found[way])]


def _displacements_um(folder: Path, bending: str) -> dict[int, FloatArray]:
    """For each number of shells, those of the rays of ``CYLINDER_UM``."""
    found = {}
    for layers in DRAWN_LAYERS:
        hits = cylinder_hits(folder / f"cylinder_{layers}", layers, bending=bending)
        found[layers] = np.linalg.norm(hits.displacement, axis=1) * 1e3
    return found


def _of_one_way(folder: Path, bending: str, found: dict[int, FloatArray]) -> list[Line]:
    lines = [
        relative(
            f"slab, 200 shells, bending={bending}, {angle}°: shift",
            exact,
            float(slab_hits(folder / "slab", angle, bending).displacement[0, 0] * 1e3),
            "µm",
            0.01,
        )
        for angle, exact in SLAB_SHIFT_UM.items()
    ]
    for layers, bound in CYLINDER_BOUND.items():
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
        if b > LAST_WITH_ORDER:
            continue
        few, more = (abs(found[layers][place] / CYLINDER_UM[b] - 1) for layers in ORDER_LAYERS)
        order = np.log(few / more) / np.log(ORDER_LAYERS[1] / ORDER_LAYERS[0])
        what = f"order from {ORDER_LAYERS[0]} to {ORDER_LAYERS[1]} shells, bending={bending}"
        lines.append(
            Line(
                f"{what}, ray at {b:g} R",
                "2",
                f"{order:.2f}",
            )
        )
    return lines


SECTION = Section(
    "exact",
    "Shells against exact solutions",
    "A slab of 20 mm whose temperature falls linearly from 1100 °C to 20 °C (n sin θ is constant "
    "in plane layers), and a hot cylinder of 13.5 mm radius in air whose temperature falls with "
    "the logarithm of the radius (n r sin θ is constant, Bouguer). n - 1 = 2.718e-4 at 20 °C. Rays "
    "are bent all along the layers, or at the shells alone (`-D bending=shells`). Second order is "
    "reached later near the silhouette, where the path through the layers has a root of the "
    "distance from the wall in it; at 0.999 R errors of both signs meet. Bent in the layers, "
    "errors change their sign near 26 shells, which makes the order look higher. What stays of "
    "0.003 % and less is what the part's facets leave.",
    _lines,
    picture=PICTURE,
    minutes=2.0,
)

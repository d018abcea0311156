"""Shells in the plume: rays that cross a column of hot air, where they touch shells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from benchmarks.accuracy.exact_shells import ANY_CAMERA
from benchmarks.accuracy.line import Line, Section, relative
from iriftrace.air import Air
from iriftrace.part import part_of_mesh
from iriftrace.render import trace_rays
from iriftrace.scene import load_scene, write_scene
from iriftrace.scenes.analytic import tube
from iriftrace.shell_levels import index_levels
from iriftrace.shell_stack import Shell, ShellStack

FloatArray = NDArray[np.float64]

AXIS_K = 600.0
WIDTH_MM = 15.0
PLATE_MM = 60.0
"""Distance of the plate behind the column from its axis."""

LAYERS = (13, 40, 160)
RAYS = 2000


def heights() -> FloatArray:
    """Distances of the rays from the column's axis, mm, evenly from the axis to two widths."""
    return (np.arange(RAYS) + 0.5) / RAYS * 2.0 * WIDTH_MM


def exact_shift(air: Air) -> FloatArray:
    r"""Shift on the plate, mm, to first order in n - 1, for n - 1 = a - B exp(-r^2 / w^2).

    The index integrated along a ray is that far from the column less
    :math:`\sqrt\pi B w \exp(-b^2 / w^2)`, the angle its derivative by b, and by symmetry the lever
    is the plate's distance from the axis.
    """
    b = heights()
    angle = 2.0 * np.sqrt(np.pi) * _depth(air) * b / WIDTH_MM * np.exp(-((b / WIDTH_MM) ** 2))
    return angle * PLATE_MM


def layered_shift(air: Air, layers: int) -> FloatArray:
    """The same for layers: a ray that enters and leaves a tube of radius r turns by the step of n
    times the tangent of the angle of incidence, twice; one that passes it by does not."""
    b = heights()
    radii, steps = _radii(air, layers)
    angle = np.zeros_like(b)
    for radius, step in zip(radii, steps, strict=True):
        inside = b < radius
        angle[inside] += 2.0 * step * b[inside] / np.sqrt(radius**2 - b[inside] ** 2)
    return angle * PLATE_MM


def traced_shift(folder: Path, air: Air, layers: int) -> FloatArray:
    """The same from the rays that are traced through tubes of 4,000 facets."""
    ambient = air.ambient_refractivity
    surfaces, e = index_levels(ambient, ambient - _depth(air), layers)
    shells = [
        Shell(k + 1, float(surfaces[k]), float(e[k]), float(e[k + 1]), *tube(radius, 60.0, 4000))
        for k, radius in enumerate(_radii(air, layers)[0].tolist())
    ]
    plate = trimesh.creation.box((80.0, 5.0, 200.0))
    plate.apply_translation((0.0, PLATE_MM + 2.5, 0.0))
    part = part_of_mesh(plate.vertices, plate.faces, name="a plate")
    stack = ShellStack(shells, air, "graded")
    scene = load_scene(write_scene(folder, part, stack, ANY_CAMERA, paraview=False))
    b = heights()
    origins = np.column_stack((np.full_like(b, 0.123), np.full_like(b, -100.0), b))
    hits = trace_rays(scene, origins, np.tile((0.0, 1.0, 0.0), (len(b), 1)))
    # Light turns away from the hot axis.
    return hits.displacement[:, 2]


def _depth(air: Air) -> float:
    return air.ambient_refractivity - float(air.refractivity(AXIS_K))


def _radii(air: Air, layers: int) -> tuple[FloatArray, FloatArray]:
    ambient, depth = air.ambient_refractivity, _depth(air)
    surfaces, e = index_levels(ambient, ambient - depth, layers)
    radii: FloatArray = WIDTH_MM * np.sqrt(np.log(depth / (ambient - surfaces)))
    return radii, -np.diff(e)


def _lines(folder: Path) -> list[Line]:
    air = Air()
    exact = exact_shift(air)
    lines, shares = [], []
    for layers in LAYERS:
        found = traced_shift(folder / str(layers), air, layers)
        off, expected = (np.abs(shift - exact) for shift in (found, layered_shift(air, layers)))
        lines.append(
            relative(
                f"{layers} shells: mean displacement",
                1e3 * exact.mean(),
                1e3 * float(found.mean()),
                "µm",
                3.0,
            )
        )
        for name, percent in (("median", 50), ("p95", 95)):
            scale = 100 / np.percentile(exact, percent)
            lines.append(
                relative(
                    f"{layers} shells: {name} of single rays' errors, share of the displacement's",
                    scale * np.percentile(expected, percent),
                    scale * np.percentile(off, percent),
                    "%",
                    2.0,
                )
            )
        shares.append(np.percentile(off, 95))
    for few, many, first, last in zip(LAYERS, LAYERS[1:], shares, shares[1:], strict=False):
        order = np.log(first / last) / np.log(many / few)
        lines.append(Line(f"order from {few} to {many} shells, p95", "1/2", f"{order:.2f}"))
    return lines


SECTION = Section(
    "plume",
    "Lines of sight across the plume",
    f"A column of hot air, {AXIS_K:g} K on its axis, whose n - 1 falls off as a Gaussian of "
    f"{WIDTH_MM:g} mm (1/e), before a plate {PLATE_MM:g} mm behind the axis; {RAYS} parallel rays "
    "up to two widths from the axis. In air whose index varies smoothly all rays turn a little; a "
    "ray that just touches a shell turns much, and one that just misses it not at all. So the "
    "error of a single ray falls only with the square root of the number of shells, whatever "
    "their normals, and the picture has streaks along the shells' outlines; means over many rays "
    "are right. What is expected of the shells' errors is the closed form for tubes. Such lines of "
    "sight are those through a plume, and along a wall at a distance; `iriftrace render "
    "--check-shells` says how far off a view is, and `--engine continuous` traces them right.",
    _lines,
)

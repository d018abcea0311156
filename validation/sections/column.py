"""Shells in the plume: rays that cross a column of hot air and turn round between shells."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from iriftrace.medium.air.refractivity import Air
from iriftrace.medium.shells.hessian import radial_derivatives
from iriftrace.medium.shells.levels import index_levels
from iriftrace.medium.shells.stack import Shell, ShellStack
from iriftrace.part.part import part_of_mesh
from iriftrace.scenes.analytic import tube
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.write import write_scene
from validation.line import Line, Section, relative
from validation.sections.exact_shells import ANY_CAMERA

FloatArray = NDArray[np.float64]

AXIS_K = 600.0
WIDTH_MM = 15.0
PLATE_MM = 60.0
"""Distance of the plate behind the column from its axis."""

LAYERS = (13, 40, 160)
RAYS = 20_000

WAYS = (("shells", "graded"), ("layers", "graded"), ("layers", "rim"))
"""Places where rays are bent, and rules of the shells."""

MEAN_BOUND = 3.0
"""Per cent."""

BOUND = {
    "graded": {13: (0.4, 5.0), 40: (0.06, 0.4), 160: (0.04, 0.06)},
    "rim": {13: (0.4, 7.0), 40: (0.1, 1.2), 160: (0.04, 0.06)},
}
"""Per cent, of median and 95th percentile of rays bent in the layers."""


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


def layered_shift(air: Air, layers: int, rule: str) -> FloatArray:
    """The same for Snell's law at shells.

    A ray that enters and leaves a tube of radius r turns by the step of n times the tangent of the
    angle of incidence, twice; one that passes it by does not.
    """
    b = heights()
    _, radii, e = _shells(air, layers, rule)
    angle = np.zeros_like(b)
    for radius, step in zip(radii, -np.diff(e), strict=True):
        inside = b < radius
        angle[inside] += 2.0 * step * b[inside] / np.sqrt(radius**2 - b[inside] ** 2)
    return angle * PLATE_MM


def traced_shift(folder: Path, air: Air, layers: int, bending: str, rule: str) -> FloatArray:
    """Shift on the plate, mm, of rays traced through tubes of 4,000 facets."""
    ambient = air.ambient_refractivity
    surfaces, radii, e = _shells(air, layers, rule)
    shells = []
    for k, radius in enumerate(radii.tolist()):
        mesh = tube(radius, 60.0, 4000)
        slope = 2.0 * radius / WIDTH_MM**2 * (ambient - surfaces[k])
        bend = slope / radius - 2.0 * radius / WIDTH_MM**2 * slope
        step = float(e[k] - e[k + 1])
        derivatives = radial_derivatives(mesh[2], slope, bend, radius, step)
        indices = float(surfaces[k]), float(e[k]), float(e[k + 1])
        shells.append(Shell(k + 1, *indices, *mesh, derivatives))
    plate = trimesh.creation.box((80.0, 5.0, 200.0))
    plate.apply_translation((0.0, PLATE_MM + 2.5, 0.0))
    part = part_of_mesh(plate.vertices, plate.faces, name="a plate")
    stack = ShellStack(shells, air, rule)
    xml = write_scene(folder, part, stack, ANY_CAMERA, paraview=False)
    scene = load_scene(xml, {"bending": bending}, engine="shells")
    b = heights()
    origins = np.column_stack((np.full_like(b, 0.123), np.full_like(b, -100.0), b))
    hits = trace_rays(scene, origins, np.tile((0.0, 1.0, 0.0), (len(b), 1)))
    # Light turns away from the hot axis.
    return hits.displacement[:, 2]


def _depth(air: Air) -> float:
    return air.ambient_refractivity - float(air.refractivity(AXIS_K))


def _shells(air: Air, layers: int, rule: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """n - 1 and radii of the surfaces, and n - 1 of the layers."""
    ambient, depth = air.ambient_refractivity, _depth(air)
    surfaces, e = index_levels(ambient, ambient - depth, layers, rule)
    radii: FloatArray = WIDTH_MM * np.sqrt(np.log(depth / (ambient - surfaces)))
    return surfaces, radii, e


def single_rays(found: FloatArray, exact: FloatArray) -> dict[str, float]:
    """Median and 95th percentile of the rays' errors, per cent of those of the displacement."""
    off = np.abs(found - exact)
    return {
        name: 100 * float(np.percentile(off, percent) / np.percentile(exact, percent))
        for name, percent in (("median", 50), ("p95", 95))
    }


def _lines(folder: Path) -> list[Line]:
    lines = []
    for bending, rule in WAYS:
        lines += _of_one_way(folder / f"{bending}_{rule}", bending, rule)
    return lines


def _of_one_way(folder: Path, bending: str, rule: str) -> list[Line]:
    air = Air()
    exact = exact_shift(air)
    lines, errors = [], []
    for layers in LAYERS:
        found = traced_shift(folder / str(layers), air, layers, bending, rule)
        what = f"{layers} shells, {rule} rule, bending={bending}"
        mean, true_mean = 1e3 * float(found.mean()), 1e3 * float(exact.mean())
        lines.append(relative(f"{what}: mean displacement", true_mean, mean, "µm", MEAN_BOUND))
        errors.append(single_rays(found, exact))
        expected = single_rays(layered_shift(air, layers, rule), exact)
        for place, (name, share) in enumerate(errors[-1].items()):
            text = f"{what}: {name} of the rays' errors over that of their displacements"
            lines.append(
                relative(text, expected[name], share, "%", 2.0)
                if bending == "shells"
                else Line(text, "0 %", f"{share:.3g} %", share, BOUND[rule][layers][place])
            )
    for few, many, first, last in zip(LAYERS, LAYERS[1:], errors, errors[1:], strict=False):
        order = np.log(first["p95"] / last["p95"]) / np.log(many / few)
        text = f"order from {few} to {many} shells, {rule} rule, bending={bending}, p95"
        lines.append(Line(text, "1/2" if bending == "shells" else "2", f"{order:.2f}"))
    return lines


SECTION = Section(
    "plume",
    "Lines of sight across the plume",
    f"A column of hot air, {AXIS_K:g} K on its axis, whose n - 1 falls off as a Gaussian of "
    f"{WIDTH_MM:g} mm (1/e), before a plate {PLATE_MM:g} mm behind the axis; {RAYS} parallel rays "
    "up to two widths from the axis. In air whose index varies smoothly all rays turn a little. "
    "Bent at the shells alone (`-D bending=shells`), by Snell's law, a ray that just touches a "
    "shell turns much, and one that just misses it not at all: the error of a single ray falls "
    "only with the square root of the number of shells, for any normals, and the picture "
    "has streaks along the shells' outlines; means over many rays are right. What is expected "
    "there is the closed form for tubes. Bent all along the layers, which is the default, their "
    "errors fall with an order of 1.4 to 2.5, until the tubes' facets are what is left. Such lines "
    "of sight are those through a plume, and along a wall at a distance; rendered "
    "with `--engine cells` too, a view shows how far off it is.",
    _lines,
)

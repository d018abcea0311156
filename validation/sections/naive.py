"""Errors of a renderer that does as renderers do: single precision and spawned rays."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.scene import Scene
from validation.line import Line, Section

MOST_CROSSINGS = 100


def naive_hits(scene: Scene, rays: Any) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Where rays meet the part, (n, 3), mm, and whether they do, as Mitsuba's own loop finds it.

    Interaction, bsdf sample, spawned ray, all in single precision, shell after shell.
    """
    import drjit as dr
    import mitsuba as mi

    ray = mi.Ray3f(*rays)
    context = mi.BSDFContext()
    point = dr.zeros(mi.Point3f, dr.width(ray.o))
    arrived = dr.full(mi.Bool, False, dr.width(ray.o))
    active = mi.Bool(True)
    part = mi.ShapePtr(next(s for s in scene.compiled.mitsuba_scene.shapes() if s.id() == "part"))
    for _ in range(MOST_CROSSINGS):
        found = scene.compiled.mitsuba_scene.ray_intersect(ray, active)
        active &= found.is_valid()
        on_part = active & (found.shape == part)
        point = dr.select(on_part, found.p, point)
        arrived |= on_part
        active &= ~on_part
        sample, _ = found.bsdf().sample(context, found, 0.5, mi.Point2f(0.5), active)
        ray = found.spawn_ray(found.to_world(sample.wo))
        dr.eval(ray, active, point, arrived)
        if not dr.any(active):
            break
    return np.array(point, dtype=np.float64).T, np.array(arrived)


def _lines(folder: Path) -> list[Line]:
    import mitsuba as mi

    from iriftrace.plugins.kernels.vertex_table import aligned

    scene = load_scene(folder_of("cylinder_paper") / "scene.xml", {"scale": 0.25}, engine="shells")
    camera: Camera = scene.camera
    sensor = scene.compiled.mitsuba_scene.sensors()[0]
    width, height = camera.resolution
    rows, columns = np.divmod(np.arange(width * height), width)
    origin, direction = sensor.rays64(
        mi.Float64(aligned(columns + 0.5)), mi.Float64(aligned(rows + 0.5))
    )
    starts, headings = (
        np.array([np.array(axis) + np.zeros(len(rows)) for axis in vector]).T
        for vector in (origin, direction)
    )
    ours = trace_rays(scene, starts, headings, coherent=True)
    rays = (
        mi.Point3f(*(aligned(axis.astype(np.float32)) for axis in starts.T)),
        mi.Vector3f(*(aligned(axis.astype(np.float32)) for axis in headings.T)),
    )
    points, arrived = naive_hits(scene, rays)
    both = arrived & (ours.status == 0)
    off = np.linalg.norm(points - ours.refracted, axis=1)[both] * 1e3
    signal = np.linalg.norm(ours.displacement, axis=1)[both] * 1e3
    return [
        Line("median displacement, the signal", "", f"{np.median(signal):.3f} µm"),
        Line("naive hits off by, median", "", f"{np.median(off):.1f} µm"),
        Line("naive hits off by, 95th percentile", "", f"{np.percentile(off, 95):.1f} µm"),
        Line(
            "naive error over signal, median by median",
            "",
            f"{np.median(off) / np.median(signal):.1f} times",
        ),
    ]


SECTION = Section(
    "naive",
    "What a renderer's own loop would give",
    "The bundled scene traced as a renderer traces glass: surface interaction, bsdf sample and "
    "spawned ray in single precision (`validation/sections/naive.py`). The hits are compared "
    "with the tracer's own. Renderers move a spawned ray off its surface, along the normal, by "
    "a fraction of its coordinates; that alone is more than the hot air does.",
    _lines,
)

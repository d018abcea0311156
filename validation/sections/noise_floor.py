"""Noise of the tracer's own arithmetic, on the real scene."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

from iriftrace.core.errors import IriftraceWarning
from iriftrace.image.aov_image import Status
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.pose_image import pose_image
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.scene import Scene
from scenes.generators.bundled import paper_copied
from validation.line import Line, Section
from validation.oracles.numpy_tracer import numpy_tracer

ORACLE_RAYS = 600
REVERSED_RAYS = 5000
CAMERA_MM = (150.0, -100.0, 120.0)
EDGE_MM = 1e-4
"""Near an edge of a shell the oracle uses the triangle that it hits and the query its own."""


def matched_scene(folder: Path, scale: float) -> Scene:
    """The bundled cylinder with shells that have one index on both sides."""
    xml = paper_copied(folder)
    xml.write_text(
        re.sub(r'(ext_ior|int_ior)" value="[^"]*"', r'\1" value="1.0002"', xml.read_text())
    )
    with warnings.catch_warnings():
        # It says that the shells do not bend; they are not meant to.
        warnings.simplefilter("ignore", IriftraceWarning)
        return load_scene(xml, {"scale": scale}, engine="shells")


def matched(folder: Path) -> list[Line]:
    """Shells that bend nothing must change nothing."""
    image = pose_image(matched_scene(folder / "matched", 0.5))
    hit = image.status != Status.MISSED
    largest = float(image.channels["displacement.norm"].max())
    lost = int((~np.isin(image.status[hit], (Status.GOOD, Status.OUT_OF_FOCUS))).sum())
    return [
        Line(
            f"index-matched shells: largest displacement of {hit.sum():,} hits",
            "0",
            f"{largest:.1e} mm",
            largest,
            1e-9,
            "mm",
        ),
        Line("index-matched shells: rays lost or miscounted", "0", str(lost), lost, 0, "rays"),
    ]


def oracle(rays: int = ORACLE_RAYS) -> list[Line]:
    """Random rays from all around, aimed at the part."""
    xml = folder_of("cylinder_paper") / "scene.xml"
    scene = load_scene(xml, {"normals": "facet"}, engine="shells")
    random = np.random.default_rng(20251121)
    start = random.normal(size=(rays, 3))
    start *= 260 / np.linalg.norm(start, axis=1, keepdims=True)
    aim = random.uniform(-1, 1, size=(rays, 3)) * (80, 10, 10)
    direction = (aim - start) / np.linalg.norm(aim - start, axis=1, keepdims=True)
    found = trace_rays(scene, start, direction)
    tracer = numpy_tracer(xml)
    endings = [tracer.trace(o, d) for o, d in zip(start, direction, strict=True)]
    crossings = np.array([ending.crossings for ending in endings])
    clear = np.array([e.point is not None and e.edge_distance > EDGE_MM for e in endings])
    expected = np.array([e.point for e, ok in zip(endings, clear, strict=True) if ok])
    error = np.linalg.norm(found.refracted[clear] - expected, axis=1)
    differing = int((crossings != found.crossings).sum())
    return [
        Line(
            f"independent NumPy tracer, {clear.sum()} hits of {rays} random rays: largest "
            "difference",
            "0",
            f"{error.max():.1e} mm",
            float(error.max()),
            1e-6,
            "mm",
        ),
        Line(
            "independent NumPy tracer: rays with another number of crossings",
            "0",
            str(differing),
            differing,
            0,
            "rays",
        ),
    ]


def sent_back() -> list[Line]:
    """Light takes the same path back."""
    scene = load_scene(folder_of("cylinder_paper") / "scene.xml", engine="shells")
    camera = np.array(CAMERA_MM)
    random = np.random.default_rng(7)
    aim = random.uniform(-1, 1, size=(REVERSED_RAYS, 3)) * (70, 9, 9)
    hits = trace_rays(scene, np.tile(camera, (REVERSED_RAYS, 1)), aim - camera)
    good = hits.status == Status.GOOD
    # From a little off the surface, so that the part itself is not hit.
    start = hits.refracted[good] - 1e-5 * hits.direction[good]
    back = trace_rays(scene, start, -hits.direction[good])
    missed_by = np.linalg.norm(np.cross(camera - back.last_point, back.direction), axis=1)
    return [
        Line(
            f"{good.sum():,} rays sent back from their hits: largest miss at the camera",
            "0",
            f"{missed_by.max():.1e} mm",
            float(missed_by.max()),
            1e-6,
            "mm",
        )
    ]


def _lines(folder: Path) -> list[Line]:
    return [*matched(folder), *oracle(), *sent_back()]


SECTION = Section(
    "noise",
    "Noise floor",
    "The bundled cylinder in its real field. Shells with the same index on both sides must "
    "change nothing; a tracer in float64 NumPy that tests every triangle and has no code in common "
    "with the plugins must find the same hits (facet normals; hits near an edge of a shell "
    "are omitted); a ray sent back from its hit must return to the camera.",
    _lines,
)

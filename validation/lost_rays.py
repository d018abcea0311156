"""Trace millions of rays from all around every scene and field, and list those that were lost.

``docs/reliability.md`` holds the table between its two marks: ``python -m validation.lost_rays``.
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from iriftrace.core.errors import IriftraceWarning
from iriftrace.core.files import whole_file
from iriftrace.flow.simulate.part_surface import mirrored_grid
from iriftrace.image.aov_image import Status
from iriftrace.io.field import read_field
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.shells.contour import contour_shells
from iriftrace.part.part import Part
from iriftrace.scenes import folder_of
from iriftrace.tracing.hot_air import AirState
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.rays import trace_rays
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.write import write_scene
from validation.inputs.solved_fields import DATA, SOLVED, camera_at

FloatArray = NDArray[np.float64]

PAGE = Path(__file__).parents[1] / "docs/reliability.md"
FLOW_MESH = "quarter_cylinder"
"""Case of a flow solver with polyhedra, of which a quarter was solved."""

MARKS = ("<!-- lost rays -->", "<!-- end of lost rays -->")

SCENES = ("concentric_cylinders", "fringe_cylinder", "gear_tooth", "slab")
"""Bundled scenes without a field; the others are cut from these."""

FIELDS = ("cylinder", "cylinder_C", "hybrid_cylinder", "bevel_gear", "wishbone", FLOW_MESH)
ENGINES = ("shells", "cells")
LAYERS = 13
PIECE = 250_000
"""Number of rays that are traced at once."""

FAR = 2.5
"""Distance of the rays' starts over the diagonal of the part."""

BESIDE = 0.02
"""Standard deviation of the aims from the part over its diagonal: some rays pass it."""


def bundle(part: Part, count: int, seed: int) -> tuple[FloatArray, FloatArray]:
    """Origins and directions (n, 3) from all around to the part and past it, mm, world."""
    rng = np.random.default_rng(seed)
    low, high = part.bounds
    size = float(np.linalg.norm(high - low))
    way = rng.normal(size=(count, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    corners = part.vertices[part.faces[rng.integers(len(part.faces), size=count)]]
    aim = np.einsum("ij,ijk->ik", rng.dirichlet((1.0, 1.0, 1.0), count), corners)
    aim += rng.normal(0.0, BESIDE * size, aim.shape)
    origin = np.mean(part.bounds, axis=0) + FAR * size * way
    return origin, aim - origin


def lost_in(scene: Scene, count: int) -> tuple[int, list[str]]:
    """Rays whose straight or refracted ray met the part, and those that were lost, in words."""
    hits, names = 0, []
    for seed, first in enumerate(range(0, count, PIECE)):
        origin, direction = bundle(scene.part, min(PIECE, count - first), seed)
        found = trace_rays(scene, origin, direction)
        hits += int((found.status != Status.MISSED).sum())
        for ray in np.flatnonzero([Status(code).lost for code in found.status]):
            start, way = origin[ray], direction[ray] / np.linalg.norm(direction[ray])
            names.append(
                f"status {found.status[ray]}, seed {seed}, ray {ray}: from "
                f"({', '.join(f'{x:.3f}' for x in start)}) along "
                f"({', '.join(f'{x:.6f}' for x in way)})"
            )
    return hits, names


def whole_field(name: str, folder: Path) -> IndexField:
    """A field of `FIELDS`, completed by its mirror images."""
    if name != FLOW_MESH:
        return SOLVED[name].field(folder)
    grid = read_field(DATA / FLOW_MESH).grid
    for axis in (0, 1):
        grid = mirrored_grid(grid, axis, 0.0)
    grid.save(folder / "whole.vtu")
    return read_field(folder / "whole.vtu")


def loaded_scenes() -> Iterator[tuple[str, str, Scene]]:
    """Name, engine and scene of all that is traced."""
    for name in SCENES:
        yield name, "shells", load_scene(folder_of(name) / "scene.xml", engine="shells")
    for name in FIELDS:
        with tempfile.TemporaryDirectory() as folder:
            field = whole_field(name, Path(folder))
            part = SOLVED["cylinder" if name == FLOW_MESH else name].part
            shells = contour_shells(field, LAYERS)
            camera = camera_at((0.0, -300.0, 100.0))
            xml = write_scene(Path(folder) / "scene", part, AirState(field, ready=shells), camera)
            for engine in ENGINES:
                yield name, engine, load_scene(xml, engine=engine)


def main() -> None:
    """Trace, print, and write the table into the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rays", type=int, default=10_000_000, help="rays in all")
    parser.add_argument("--write", action="store_true", help="write the table into the page")
    given = parser.parse_args()
    warnings.simplefilter("ignore", IriftraceWarning)
    count = len(SCENES) + len(ENGINES) * len(FIELDS)
    each = -(-given.rays // count)
    rows = [
        "| scene | engine | rays | hits | status 5 | status 6 |",
        "| --- | --- | ---: | ---: | ---: | ---: |",
    ]
    named = []
    for name, engine, scene in loaded_scenes():
        hits, lost = lost_in(scene, each)
        five, six = (sum(text.startswith(f"status {code}") for text in lost) for code in (5, 6))
        rows.append(f"| {name} | {engine} | {each:,} | {hits:,} | {five} | {six} |")
        print(rows[-1], flush=True)
        named += [f"- {name}, {engine}: {text}" for text in lost]
    table = "\n".join([*rows, "", *(named or ["No ray was lost."])])
    print(table)
    if given.write:
        text = PAGE.read_text(encoding="utf-8")
        head, rest = text.split(MARKS[0])
        _, tail = rest.split(MARKS[1])
        with whole_file(PAGE) as temporary:
            temporary.write_text(f"{head}{MARKS[0]}\n{table}\n{MARKS[1]}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main()

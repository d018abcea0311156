"""Memory and time in which large inputs become a scene, by cell of the field or triangle of a part.

Each input is read in a process of its own, whose peak memory is that of the input alone.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
import warnings
from pathlib import Path
from threading import Event, Thread

import numpy as np
import psutil
import pyvista as pv
from attrs import frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import IriftraceWarning
from iriftrace.flow.synthetic.model import SyntheticAir
from iriftrace.io.field import read_field
from iriftrace.io.part_files import read_part, save_part
from iriftrace.part.part import part_of_mesh
from iriftrace.scenes import folder_of
from iriftrace.tracing.hot_air import HotAir
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene

CELLS = 302_400
"""Hexahedra of each field. Below 100,000 the memory of libraries is a large part."""

TRIANGLES = 1_000_000

HALL_MM, PLUME_MM = 300.0, 60.0
"""Outer radius of air that is mostly ambient, and of air that is hot everywhere."""

PART_RADIUS_MM, HALF_LENGTH_MM = 13.5, 85.0
"""Of the bundled cylinder."""


@frozen
class Size:
    """Cost of one input."""

    name: str
    count: int  # cells or triangles
    peak_bytes: float  # of a cell or triangle
    seconds: float  # of a processor, of a million


def sizes(folder: Path) -> list[Size]:
    """Costs of two fields and a part, which are written to a folder."""
    inputs = {
        "field of a hall, cells": hexahedra(folder / "hall.vtu", HALL_MM, 0.0),
        "field without ambient air, cells": hexahedra(folder / "full.vtu", PLUME_MM, 1.0),
        "part, triangles": torus(folder / "torus.ply"),
    }
    found = []
    for name, (path, count) in inputs.items():
        words = [sys.executable, "-m", "bench.size", str(path), str(folder / path.stem)]
        output = subprocess.run(words, check=True, capture_output=True, text=True).stdout
        peak, seconds = json.loads(output)
        found.append(Size(name, count, peak / count, 1e6 * seconds / count))
    return found


def hexahedra(path: Path, radius_mm: float, excess_k: float) -> tuple[Path, int]:
    """Write the synthetic air around the bundled cylinder on hexahedra, and count these."""
    air = SyntheticAir(read_part(folder_of("cylinder") / "part.ply"))
    scale = (CELLS / 302_400) ** (1 / 3)
    nx, nt, nr = (round(scale * count) for count in (60, 70, 72))
    rising = np.expm1(3.0 * np.linspace(0.0, 1.0, nr + 1)) / np.expm1(3.0)
    x, angle, radius = np.meshgrid(
        np.linspace(-HALF_LENGTH_MM, HALF_LENGTH_MM, nx + 1),
        np.linspace(0.0, 2.0 * np.pi, nt, endpoint=False),
        PART_RADIUS_MM + (radius_mm - PART_RADIUS_MM) * rising,
        indexing="ij",
    )
    points = np.stack((x, radius * np.cos(angle), radius * np.sin(angle)), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape(x.shape)
    turned = np.roll(number, -1, axis=1)
    inner = [
        face[:, :, side]
        for face, side in (
            *((number, slice(-1)), (turned, slice(-1))),
            *((turned, slice(1, None)), (number, slice(1, None))),
        )
    ]
    corners = [face[part] for part in (slice(-1), slice(1, None)) for face in inner]
    cells = np.stack([corner.ravel() for corner in corners], axis=1)
    grid = pv.UnstructuredGrid({pv.CellType.HEXAHEDRON: cells}, points)
    blocks = np.array_split(points, 1 + len(points) // 100_000)
    kelvin: FloatArray = np.concatenate([air.at(block)[0] for block in blocks])
    grid.point_data["T"] = kelvin + excess_k
    grid.save(path)
    return path, grid.n_cells


def torus(path: Path) -> tuple[Path, int]:
    """Write a torus of triangles, and count these."""
    count = round((TRIANGLES / 2) ** 0.5)
    turn = 2.0 * np.pi * np.arange(count) / count
    u, v = np.meshgrid(turn, turn, indexing="ij")
    ring = 40.0 + 12.0 * np.cos(v)
    points = np.stack((ring * np.cos(u), ring * np.sin(u), 12.0 * np.sin(v)), axis=-1)
    a = np.arange(count**2).reshape(count, count)
    b, d = np.roll(a, -1, axis=0), np.roll(a, -1, axis=1)
    c = np.roll(b, -1, axis=1)
    halves = [np.stack(half, axis=-1).reshape(-1, 3) for half in ((a, b, c), (a, c, d))]
    part = part_of_mesh(points.reshape(-1, 3), np.concatenate(halves), name="torus")
    save_part(part, path)
    return path, len(part.faces)


def cost_of(path: Path, folder: Path) -> tuple[int, float]:
    """Peak memory, bytes, that an input adds to the libraries', and processor seconds.

    A field becomes a scene of the bundled cylinder. A part is read, and points are compared with
    its surface.
    """
    bundled = folder_of("cylinder")
    scene = load_scene(bundled / "scene.xml")
    process, done = psutil.Process(), Event()
    before = peak = process.memory_info().rss
    started = time.process_time()

    def watch() -> None:
        nonlocal peak
        while not done.wait(0.002):
            peak = max(peak, process.memory_info().rss)

    watcher = Thread(target=watch)
    watcher.start()
    try:
        if path.suffix == ".ply":
            surface = read_part(path).surface
            surface.inside(np.zeros((1, 3)))
            surface.distance(np.zeros((1, 3)))
        else:
            field = read_field(path, part=scene.part)
            Scene(scene.part, HotAir(field), scene.camera).save(folder / "scene.xml")
    finally:
        done.set()
        watcher.join()
    return peak - before, time.process_time() - started


if __name__ == "__main__":
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IriftraceWarning)
        print(json.dumps(cost_of(Path(sys.argv[1]), Path(sys.argv[2]))))

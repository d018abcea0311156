"""Writes fields as EnSight Gold, text or binary, with one state or several."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyvista as pv
from numpy.typing import NDArray


def write(
    path: Path,
    grid: pv.UnstructuredGrid,
    states: Sequence[NDArray[np.float64]],
    *,
    binary: bool,
    times: Sequence[float] = (),
) -> Path:
    """Write hexahedra or voxels with the temperature T at the points in each state.

    Files are named after the case: ``a.case`` has ``a.geo`` and ``a.T``, or ``a0.T`` and so on
    where `times` has the states' times, s.
    """
    cells = np.asarray(grid.cell_connectivity).reshape(-1, 8) + 1
    if (np.asarray(grid.celltypes) == pv.CellType.VOXEL).all():
        # VTK's voxels have two pairs of corners the other way round.
        cells = cells[:, [0, 1, 3, 2, 4, 5, 7, 6]]
    points = np.asarray(grid.points)

    def line(text: str) -> bytes:
        return text.ljust(80).encode() if binary else f"{text}\n".encode()

    def number(value: int) -> bytes:
        return struct.pack("<i", value) if binary else f"{value:10d}\n".encode()

    def integers(rows: NDArray[np.int64]) -> bytes:
        if binary:
            return rows.astype("<i4").tobytes()
        return "".join("".join(f"{v:10d}" for v in row) + "\n" for row in rows).encode()

    def reals(values: NDArray[np.float64]) -> bytes:
        if binary:
            return values.astype("<f4").tobytes()
        return "".join(f"{v:12.5e}\n" for v in values).encode()

    geometry = line("C Binary") if binary else b""
    geometry += b"".join(map(line, ("made", "of air", "node id off", "element id off")))
    geometry += line("part") + number(1) + line("air") + line("coordinates") + number(len(points))
    geometry += b"".join(reals(axis) for axis in points.T)
    geometry += line("hexa8") + number(len(cells)) + integers(cells)
    stem = path.stem
    (path.parent / f"{stem}.geo").write_bytes(geometry)
    for step, kelvins in enumerate(states):
        text = line("T") + line("part") + number(1) + line("coordinates") + reals(kelvins)
        (path.parent / (f"{stem}{step}.T" if times else f"{stem}.T")).write_bytes(text)
    case = ["FORMAT", "type: ensight gold", "GEOMETRY", f"model: {stem}.geo", "VARIABLE"]
    if times:
        case += [f"scalar per node: 1 T {stem}*.T", "TIME", "time set: 1"]
        case += [f"number of steps: {len(times)}", "filename start number: 0"]
        case += ["filename increment: 1", "time values:", *map(str, times)]
    else:
        case += [f"scalar per node: T {stem}.T"]
    path.write_text("\n".join(case) + "\n", encoding="utf-8")
    return path

"""A ring in a hall: draught, a body and a floor, on a fine and on coarse meshes."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh

import iriftrace
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import IriftraceWarning
from iriftrace.io.part_files import save_part
from iriftrace.medium.index_field import IndexField
from iriftrace.part.part import Part, part_of_mesh
from validation.flow.simulated import simulated
from validation.flow.table import Table, per_cent
from validation.inputs.cameras import camera_at

BACKGROUNDS_MM = (18.9, 32.0, 40.0)
"""Background cells, the finest first, against which the others are compared."""

LATER_MM, LATER = 32.0, ("--end-time", "4.5 s", "--average-time", "0.9 s")
"""Background cells of a solution that is averaged later, and its times."""

DISTANCE_MM, BASE_MM = 400.0, 150.0
VIEWS = {
    "leeward, level": (-1.0, 0.0),
    "leeward, 30° above": (-1.0, 30.0),
    "windward, level": (1.0, 0.0),
    "windward, 30° above": (1.0, 30.0),
}
"""Side of the devices along y, and their elevation, degrees; the draught comes from +y."""

TEXT = f"""\
A ring of 120 mm with a bore of 20.2 mm, 30 mm wide, its axis along y, at 1050 °C in a draught of
0.2 m/s from +y, 5 mm above a block on a floor: error along the normal that two devices
{DISTANCE_MM:g} mm away and {BASE_MM:g} mm apart make (median of its size). Only the cells of the
flow solution differ. The minutes are those of mesher and solver on two cores. `iriftrace field
simulate` states cells and minutes before the solver starts, and names a coarser mesh if that takes
more than 15 minutes.

From the windward side coarse cells change the error by less than 5 %. From leeward the devices look
through the plume, which is not steady there: these errors depend on the mesh without order, and on
the time that is averaged (last row). Measure from windward if you can; else state what two meshes
differ by (`mesh` in [the answer](uncertainty.md)), or let a [board](board.md) choose the air."""


def ring() -> Part:
    """The hot ring, its centre at the origin."""
    mesh = trimesh.creation.annulus(r_min=10.1, r_max=60.0, height=30.0, sections=96)
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2.0, (1.0, 0.0, 0.0)))
    return part_of_mesh(mesh.vertices, mesh.faces, name="ring")


def block() -> Part:
    """The block below the ring, which stands on the floor."""
    box = trimesh.creation.box(bounds=((-80.0, -30.0, -100.0), (80.0, 30.0, -65.0)))
    return part_of_mesh(box.vertices, box.faces, name="block")


def hall_table(folder: Path, backgrounds: Sequence[float] = BACKGROUNDS_MM) -> Table:
    """Errors on the finest mesh, and how much those on the others differ."""
    table, finest = Table(list(VIEWS)), None
    for background in backgrounds:
        field, cells, seconds = solved(folder / "hall", background)
        name = f"{background / 16:.2f} mm at the wall, {cells:,} cells, {seconds / 60:.0f} minutes"
        errors = normal_errors(field)
        if finest is None:
            finest = errors
            table.expected(f"{name}: µm", 1e3 * errors, 3)
        else:
            table.difference(name, per_cent(errors, finest))
    field, _, _ = solved(folder / "hall" / "later", LATER_MM, *LATER)
    name = f"{LATER_MM / 16:.2f} mm at the wall, averaged over the next 0.9 s"
    table.difference(name, per_cent(normal_errors(field), finest))
    return table


def solved(folder: Path, background_mm: float, *times: str) -> tuple[IndexField, int, float]:
    """Field of the ring, solved unless the folder has it; number of cells, and seconds it took."""
    folder.mkdir(parents=True, exist_ok=True)
    body = folder / "block.stl"
    save_part(block(), body)
    case = folder / f"{background_mm:g}mm"
    field, cells = simulated(
        ring(),
        case,
        *("--wall-temperature", "1050 degC", "--background-cell", f"{background_mm} mm"),
        *("--draught", "0.2 m/s", "--draught-from", "90"),
        *("--body", str(body), "--floor", "-100 mm", "--processes", "2"),
        *times,
    )
    return field, cells, float((case / "seconds").read_text())


def normal_errors(field: IndexField) -> FloatArray:
    """Median size of the error along the normal in each of the `VIEWS`, mm."""
    return np.array([_normal_error(field, *view) for view in VIEWS.values()])


def _normal_error(field: IndexField, side: float, elevation_deg: float) -> float:
    elevation = np.radians(elevation_deg)
    devices = [
        camera_at(
            (x, side * DISTANCE_MM * np.cos(elevation), DISTANCE_MM * np.sin(elevation)),
            focal_length_mm=16.0,
            sensor_mm=(8.0, 6.4),
            resolution=(100, 80),
        )
        for x in (-0.5 * BASE_MM, 0.5 * BASE_MM)
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IriftraceWarning)  # the block ends the field
        scene = iriftrace.Scene(
            ring(), iriftrace.HotAir(field), devices[0], engine="cells", blockers=(block(),)
        )
        scan = iriftrace.measure(scene, *devices, system="stereo")
    return float(np.median(np.abs(scan.error_normal)))

"""Fields of `iriftrace field simulate` for the page, and rays through their middle."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pyvista as pv
import trimesh
from attrs import evolve, frozen

import iriftrace
from iriftrace.cli import main
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import IriftraceWarning
from iriftrace.io.field import read_field
from iriftrace.io.part_files import save_part
from iriftrace.medium.index_field import IndexField
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.tracing.rays import trace_rays
from validation.inputs.cameras import camera_at

CAMERA = camera_at(
    (0.0, -500.0, 0.0), focal_length_mm=25.0, sensor_mm=(8.0, 6.0), resolution=(8, 6)
)
"""Camera far from the hot air, needed for a scene; the rays do not start from it."""


ROOM_C = 20.0


@frozen
class Run:
    """A simulation: temperature, mesh and times."""

    wall_c: float
    background_mm: float
    seconds: float
    averaged: float

    def at(self, wall_c: float) -> Run:
        """The same of another wall, for longer if it is cooler, since its air rises more slowly."""
        slower = max(np.sqrt((self.wall_c - ROOM_C) / (wall_c - ROOM_C)), 1.0)
        return evolve(self, wall_c=wall_c, seconds=round(self.seconds * slower, 1))

    @property
    def name(self) -> str:
        """Name of the case's folder."""
        return f"{self.wall_c:g}C_{self.background_mm:g}mm"

    def field(self, part: Part, folder: Path) -> tuple[IndexField, str]:
        """The field of a part, simulated unless the folder has it, and what its mesh is."""
        field, cells = simulated(
            part,
            folder / self.name,
            *("--symmetry", "xy", "--margin", "0.5"),
            *("--wall-temperature", f"{self.wall_c} degC"),
            *("--background-cell", f"{self.background_mm} mm"),
            *("--end-time", f"{self.seconds} s", "--average-time", f"{self.averaged} s"),
        )
        return field, f"{self.background_mm / 16:.2f} mm at the wall, {cells:,} cells"


def simulated(part: Part, case: Path, *options: str) -> tuple[IndexField, int]:
    """Field of a part, solved with these options unless it is next to the case; number of cells."""
    file = case.with_name(f"{case.name}.vtu")
    if not file.is_file():
        case.parent.mkdir(parents=True, exist_ok=True)
        save_part(part, case.with_name("part.ply"))
        words = ["field", "simulate", str(case.with_name("part.ply")), "-o", str(case)]
        if code := main([*words, "--field", str(file), *options]):
            raise SystemExit(code)
    return read_field(file), int(json.loads((case / "mesh.json").read_text())["cells"])


def solved_wall(case: Path) -> pv.PolyData:
    """The part's wall in a case at its last time, with the solver's heat flux; lengths in m."""
    (case / "case.foam").touch()
    reader = pv.OpenFOAMReader(str(case / "case.foam"))
    reader.set_active_time_value(reader.time_values[-1])
    reader.disable_all_patch_arrays()
    reader.enable_patch_array("patch/part")
    return reader.read()["boundary"]["part"]


def bent(field: IndexField, body: Part, starts: FloatArray, width_mm: float) -> FloatArray:
    """Angles (n, 2) towards y and z, rad, of rays along x bent by the cells engine over a width.

    The rays start at `starts` (n, 3), mm, in the air next to a body, and end on a board there.
    """
    box = trimesh.creation.box((1.0, 200.0, 200.0))
    box.apply_translation((starts[0, 0] + width_mm + 0.5, *starts.mean(axis=0)[1:]))
    board = part_of_mesh(box.vertices, box.faces, name="board")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", IriftraceWarning)  # the board stands in the field
        scene = iriftrace.Scene(
            board, iriftrace.HotAir(field), CAMERA, engine="cells", blockers=(body,)
        )
        hits = trace_rays(scene, starts, np.tile((1.0, 0.0, 0.0), (len(starts), 1)))
    if hits.status.any():
        raise ValueError(f"rays do not reach the board: status {hits.status.tolist()}")
    angles: FloatArray = np.arctan2(hits.direction[:, 1:], hits.direction[:, :1])
    return angles

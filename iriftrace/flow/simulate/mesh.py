"""Mesh of a case: blocks, features of the part, refinement and snapping to it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyvista as pv
from vtkmodules.vtkIOGeometry import vtkOpenFOAMReader

from iriftrace.core.files import text_in, write_whole
from iriftrace.flow.simulate.case import Case, read_record
from iriftrace.flow.simulate.case_files import nonuniform, uniform, write_start
from iriftrace.flow.simulate.programs import Installation, OpenFoamError, cell_count, run_program
from iriftrace.io.vtk_files import blocks_by_name
from iriftrace.part.wall_temperature import wall_temperature

_DONE = "mesh.json"

_STEPS = (
    ("blocks", "blockMesh", ()),
    ("edges of the part", "surfaceFeatureExtract", ()),
    ("cells around the part", "snappyHexMesh", ("-overwrite",)),
    ("check", "checkMesh", ()),
)


def make_mesh(
    case: Case,
    folder: Path,
    installation: Installation,
    say: Callable[[str], None],
    like: Path | None = None,
) -> int:
    """Make the mesh and the fields at time 0 on it unless it exists; returns its number of cells.

    `like` is the folder of a case whose mesh is copied. Refuses a mesh that lost the part.
    """
    done = folder / _DONE
    if done.is_file():
        return int(read_record(done)["cells"])
    shutil.rmtree(folder / "constant/polyMesh", ignore_errors=True)
    cells = None
    if like is None:
        for what, program, arguments in _STEPS:
            say(f"Mesh: {what}")
            log = run_program(installation, folder, program, *arguments)
            cells = cell_count(text_in(log))
    else:
        cells = int(read_record(like / _DONE)["cells"])
        shutil.copytree(like / "constant/polyMesh", folder / "constant/polyMesh")
    wall = wall_patch(folder)
    if not cells or not wall.n_cells:
        raise OpenFoamError(
            f"the mesh in {folder} has no faces on the part: the mesher lost it; is the part "
            "closed and not thinner than the cells?",
            code="mesh.no_part",
        )
    centres = np.asarray(wall.cell_centers().points, dtype=np.float64) * 1000.0
    kelvins = wall_temperature(case.wall, case.part, centres)
    same = not case.wall.varies(case.part)
    write_start(case, folder, uniform(float(kelvins[0])) if same else nonuniform(kelvins))
    write_whole(done, json.dumps({"cells": cells, "wall_faces": wall.n_cells}) + "\n")
    return cells


def wall_patch(folder: Path) -> pv.PolyData:
    """The wall of a meshed case: faces in the order of the mesh, in m."""
    reader = vtkOpenFOAMReader()
    reader.SetFileName(str(folder / "case.foam"))
    reader.SetSkipZeroTime(False)
    reader.UpdateInformation()
    reader.DisableAllPatchArrays()
    reader.SetPatchArrayStatus("patch/part", 1)
    reader.Update()
    data: pv.MultiBlock = pv.wrap(reader.GetOutput())
    patch = blocks_by_name(blocks_by_name(data).get("boundary")).get("part")
    return patch if isinstance(patch, pv.PolyData) else pv.PolyData()

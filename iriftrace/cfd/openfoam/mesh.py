"""Makes the mesh of a case: blocks, features of the part, refinement and snapping to it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyvista as pv
from attrs import frozen
from vtkmodules.vtkIOGeometry import vtkOpenFOAMReader

from iriftrace.cfd.openfoam.case import Case, read_record
from iriftrace.cfd.openfoam.case_files import START_FILES, nonuniform, uniform, write_start
from iriftrace.cfd.openfoam.programs import Installation, OpenFoamError, cell_count, run_program
from iriftrace.cfd.openfoam.wall import wall_temperature
from iriftrace.core.files import whole_file
from iriftrace.field.readers.openfoam import processor_folders

_DONE = "mesh.json"

_STEPS = (
    ("blocks", "blockMesh", ()),
    ("edges of the part", "surfaceFeatureExtract", ()),
    ("cells around the part", "snappyHexMesh", ("-overwrite",)),
    ("check", "checkMesh", ()),
)


@frozen
class Neighbour:
    """Meshed case of the same part and air, with another draught."""

    folder: Path
    solved: bool = False  # its last state is where the solution starts, and not just its mesh


def make_mesh(
    case: Case,
    folder: Path,
    installation: Installation,
    say: Callable[[str], None],
    neighbour: Neighbour | None = None,
) -> int:
    """Make the mesh unless it is there, and the fields at time 0 on it; its number of cells.

    `say` is told what is being done; the mesh is that of the `neighbour`, where there is one. An
    OpenFoamError if the mesher failed, or lost the part.
    """
    done = folder / _DONE
    if done.is_file():
        return int(read_record(done)["cells"])
    shutil.rmtree(folder / "constant/polyMesh", ignore_errors=True)
    if neighbour is None:
        cells = _new_mesh(folder, installation, say)
    else:
        cells = int(read_record(neighbour.folder / _DONE)["cells"])
        shutil.copytree(neighbour.folder / "constant/polyMesh", folder / "constant/polyMesh")
    wall = wall_patch(folder)
    if not cells or not wall.n_cells:
        raise OpenFoamError(
            f"the mesh in {folder} has no faces on the part: the mesher lost it; is the part "
            "closed and not thinner than the cells?"
        )
    centres = np.asarray(wall.cell_centers().points, dtype=np.float64) * 1000.0
    kelvins = wall_temperature(case.wall, case.part, centres)
    same = len(case.wall.of_regions(case.part)) == 1
    write_start(case, folder, uniform(float(kelvins[0])) if same else nonuniform(kelvins))
    if neighbour is not None and neighbour.solved:
        say("State of the neighbour")
        _map_state(neighbour.folder, folder, installation)
    with whole_file(done) as temporary:
        temporary.write_text(json.dumps({"cells": cells, "wall_faces": wall.n_cells}) + "\n")
    return cells


def _new_mesh(folder: Path, installation: Installation, say: Callable[[str], None]) -> int:
    """Run the mesher; the number of cells, 0 where its check does not tell."""
    for what, program, arguments in _STEPS:
        say(f"Mesh: {what}")
        log = run_program(installation, folder, program, *arguments)
    return cell_count(log.read_text(errors="replace")) or 0


def _map_state(source: Path, folder: Path, installation: Installation) -> None:
    """Replace the inner values of the fields at time 0 by a solved case's last ones.

    Both have the same mesh, so each cell gets its own value; the boundaries stay as written.
    """
    pieces = ("-parallelSource",) if processor_folders(source) else ()
    last = ("-sourceTime", "latestTime", "-mapMethod", "mapNearest", *pieces)
    run_program(installation, folder, "mapFields", str(source.absolute()), *last)
    # It maps averages and rates as well, which would be taken for those of this case.
    for file in (folder / "0").iterdir():
        if f"0/{file.name}" not in START_FILES:
            file.unlink()


def wall_patch(folder: Path) -> Any:
    """The wall of a meshed case as pyvista.PolyData: faces in the order of the mesh, in m."""
    reader = vtkOpenFOAMReader()
    reader.SetFileName(str(folder / "case.foam"))
    reader.SetSkipZeroTime(False)
    reader.UpdateInformation()
    reader.DisableAllPatchArrays()
    reader.SetPatchArrayStatus("patch/part", 1)
    reader.Update()
    data: Any = pv.wrap(reader.GetOutput())
    boundary = data["boundary"] if "boundary" in data.keys() else None
    if boundary is None or "part" not in boundary.keys():
        return pv.PolyData()
    return boundary["part"]

"""Read one state of an XDMF file (``.xdmf``, ``.xmf``), as FEniCS, meshio and others write it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv

from iriftrace.core.files import sha256_of
from iriftrace.io.states import Contents, State, state_number, states_at
from iriftrace.io.vtk_check import Data, read_xdmf
from iriftrace.io.vtk_files import blocks_of


def states(path: Path) -> list[State]:
    """Label and time of every state in a file, at least one."""
    return states_at(read_xdmf(path, None)[1])


def read(path: Path, member: int | None) -> Contents:
    """The grids of one state; raises InputError if the file or one that it names is damaged."""
    found = states(path)
    number = state_number(found, member, path)
    data, _ = read_xdmf(path, number)
    return Contents(_meshes(data), sha256_of(path), found, origin=found[number][0])


def _meshes(data: Data) -> pv.MultiBlock:
    """Each mesh once, with all its arrays; FEniCS writes it again for each function."""
    meshes: list[pv.DataSet] = []
    for grid in blocks_of(data):
        mesh = next((mesh for mesh in meshes if _same_cells(mesh, grid)), None)
        if mesh is None:
            meshes.append(grid)
        else:
            mesh.point_data.update(grid.point_data)
            mesh.cell_data.update(grid.cell_data)
    return pv.MultiBlock(meshes)


def _same_cells(one: pv.DataSet, other: pv.DataSet) -> bool:
    """True for grids with equal points and cells."""
    # Only unstructured grids list their cells.
    mine, theirs = (getattr(grid, "cells", ()) for grid in (one, other))
    return np.array_equal(one.points, other.points) and np.array_equal(mine, theirs)

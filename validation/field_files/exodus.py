"""Writes fields as Exodus by VTK's own writer, which is ParaView's."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from scipy.io import netcdf_file

_WRITE = """
import sys, pyvista
from vtkmodules.vtkIOExodus import vtkExodusIIWriter
writer = vtkExodusIIWriter()
writer.SetFileName(sys.argv[2])
writer.SetInputData(pyvista.read(sys.argv[1]))
writer.WriteAllTimeStepsOff()
writer.Write()
"""
"""A process of its own: VTK's HDF5 library crashes next to that of h5py."""


def write(
    path: Path, grid: pv.UnstructuredGrid, later: Sequence[tuple[float, NDArray[np.float64]]] = ()
) -> Path:
    """Write a grid with its one point array at t = 0, and its values at later times."""
    given = path.with_name(f"{path.name}.vtu")
    grid.save(given)
    subprocess.run([sys.executable, "-c", _WRITE, str(given), str(path)], check=True)
    given.unlink()
    if later:
        # The writer takes further times from a pipeline alone; in the file they are records.
        with netcdf_file(str(path), "a", mmap=False) as file:
            for step, (time, values) in enumerate(later, start=1):
                file.variables["time_whole"][step] = time
                file.variables["vals_nod_var1"][step] = values
    return path

"""Child processes run nothing that lies in the working folder."""

from __future__ import annotations

from pathlib import Path

import h5netcdf
import pytest
import pyvista as pv

from iriftrace.core.netcdf import check_netcdf
from iriftrace.field.readers import vtk_process


def test_modules_of_the_working_folder_are_not_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither a package of our name nor one that we import."""
    marker = tmp_path / "ran"
    for name in ("iriftrace", "numpy", "vtkmodules", "h5netcdf"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(f"open({str(marker)!r}, 'w')\n1 / 0\n")
    with h5netcdf.File(tmp_path / "good.nc", "w") as file:
        file.dimensions = {"x": 1}
        file.create_variable("v", ("x",), data=[1.0])
    pv.Sphere().save(tmp_path / "good.vtp")
    monkeypatch.chdir(tmp_path)
    vtk_process._child.stop()
    check_netcdf(tmp_path / "good.nc")
    assert vtk_process.read_file(tmp_path / "good.vtp").n_points > 0
    assert not marker.exists()

"""A cloud that was corrected already is refused, also after other programs have saved it."""

from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from iriftrace.core.errors import InputError
from iriftrace.io.clouds import read_cloud

POINTS = np.random.default_rng(1).uniform(-100, 100, (20, 7))


def write(path: Path, header: str, columns: int, mark: str = ",") -> Path:
    """A table of the first columns of `POINTS`."""
    np.savetxt(path, POINTS[:, :columns], "%.17g", mark, header=header, comments="")
    return path


@pytest.mark.parametrize(
    "header",
    [
        "//X Y Z correction_x correction_y correction_z status",
        "x,y,z,scalar_correction_x,scalar_correction_y,scalar_correction_z,i",
        "x;y;z;correction:0;correction:1;correction:2;i",
    ],
)
def test_a_table_that_was_corrected_is_refused(header: str, tmp_path: Path) -> None:
    mark = next((mark for mark in ";," if mark in header), " ")
    cloud = write(tmp_path / "cloud.csv", header, 7, mark)
    with pytest.raises(InputError, match="corrected already"):
        read_cloud(cloud)


def test_a_cloud_that_cloudcompare_saved_again_is_refused(tmp_path: Path) -> None:
    data = pv.PolyData(POINTS[:, :3])
    data.point_data["scalar_correction_x"] = POINTS[:, 3]
    data.save(tmp_path / "cloud.vtp")
    with pytest.raises(InputError, match="corrected already"):
        read_cloud(tmp_path / "cloud.vtp")
    header = "ply\nformat ascii 1.0\nelement vertex 1\n"
    names = ("x", "y", "z", "scalar_correction_x", "scalar_correction_y", "scalar_correction_z")
    properties = "".join(f"property float {name}\n" for name in names)
    (tmp_path / "cc.ply").write_text(f"{header}{properties}end_header\n1 2 3 4 5 6\n")
    with pytest.raises(InputError, match="corrected already"):
        read_cloud(tmp_path / "cc.ply")


@pytest.mark.parametrize("name", ["distortion_correction_x", "after correction for the lens"])
def test_names_of_other_corrections_are_none(name: str, tmp_path: Path) -> None:
    cloud = write(tmp_path / "cloud.csv", f"x,y,z,{name}", 4)
    assert name in read_cloud(cloud).columns

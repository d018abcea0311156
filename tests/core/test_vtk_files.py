"""VTK files on a disk that gets full: one sentence, where VTK's own writers end the process."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from iriftrace.core.blocks import CloudBlocks
from iriftrace.io.vtk_write import write_vtk, write_vtp_blocks

FULL = """
import resource, sys
import numpy as np, pyvista as pv
from iriftrace.core.errors import InputError
from iriftrace.io.vtk_write import write_vtk
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
try:
    write_vtk(sys.argv[1], pv.PolyData(np.random.default_rng(0).random((10_000, 3))))
except InputError as error:
    print(error)
"""


@pytest.mark.parametrize("fast", [True, False])
@pytest.mark.parametrize("name", ["a.vtp", "a.vtu"])
def test_what_is_written_is_read_again(tmp_path: Path, name: str, fast: bool) -> None:
    points = pv.PolyData(np.random.default_rng(1).random((100, 3)).astype(np.float32))
    points.point_data["T"] = np.arange(100.0)
    points.field_data["origin"] = ["hot air"]
    data = points if name == "a.vtp" else points.cast_to_unstructured_grid()
    write_vtk(tmp_path / name, data, fast=fast)
    assert pv.read(tmp_path / name) == data


def test_a_full_disk_is_one_sentence(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", FULL, str(tmp_path / "a.vtp")], capture_output=True, text=True
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"cannot write {tmp_path / 'a.vtp'}: ")
    assert not list(tmp_path.iterdir())


def test_a_cloud_in_blocks_is_read_by_vtk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each kind of column, also with a last block that is shorter or as long as the others."""
    random = np.random.default_rng(0)
    places = random.random((1000, 3))
    places[3] = np.nan, np.inf, 1.0
    columns = {
        'far & "near" <x>': random.random(1000),
        "single": random.random(1000).astype(np.float32),
        "byte": random.integers(0, 255, 1000).astype(np.uint8),
        "number": random.integers(-9, 9, 1000).astype(np.int32),
        "flag": random.random(1000) < 0.5,
    }
    for size in (64, 100, 5000):
        monkeypatch.setattr("iriftrace.core.blocks.BLOCK", size)
        path = tmp_path / "cloud.vtp"
        cloud = CloudBlocks.of_arrays(places, columns)
        write_vtp_blocks(path, cloud, {"field": "flow of Ångström & Co."})
        found = pv.read(path)
        np.testing.assert_array_equal(found.points[4:], places[4:])
        np.testing.assert_array_equal(found.points[3], (0.0, 0.0, 1.0))
        assert found.n_verts == len(places)
        assert list(found.field_data["field"]) == ["flow of Ångström & Co."]
        for name, column in columns.items():
            np.testing.assert_array_equal(found.point_data[name], column)
            assert found.point_data[name].dtype == (column + np.uint8(0)).dtype

"""Sweeps from the command line: schedulers, lists of poses, failed poses, products of options."""

import importlib.util
import re
import shlex
import shutil
import socket
from pathlib import Path

import numpy as np
import pytest
import trimesh
from failing import Failing

from iriftrace.cli import main
from iriftrace.planning.criteria import Criteria
from iriftrace.planning.summary import summarise
from iriftrace.scenes import folder_of
from iriftrace.sweep.store import read_sweep
from validation.inputs.hot_block import HotBlock

ORBIT = "--azimuth 0:90:2 --elevation 30"


def test_scheduler_that_does_not_answer(
    fails: Failing, hot: HotBlock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("iriftrace.sweep.workers._SECONDS_TO_ANSWER", 0.5)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    line = f"sweep {hot.scene} -o a.nc {ORBIT} --scheduler {address}"
    refusal = fails(*line.split())
    assert re.search(rf"{address};.*\(--scheduler\)", refusal)
    assert refusal.code == "scheduler.no_answer"


@pytest.mark.parametrize(
    ("option", "package", "module", "code"),
    [
        ("--scheduler local", "distributed", "sweep.workers", "workers.no_dask"),
        ("--export a.parquet", "pyarrow", "sweep.export", "table.no_pyarrow"),
    ],
)
def test_what_is_not_installed(
    fails: Failing,
    hot: HotBlock,
    monkeypatch: pytest.MonkeyPatch,
    option: str,
    package: str,
    module: str,
    code: str,
) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(
        f"iriftrace.{module}.find_spec", lambda name: None if name == package else found(name)
    )
    message = fails(*f"sweep {hot.scene} -o a.nc {ORBIT} {option}".split())
    assert re.search(rf"{package}.* pip install -e '\.\[.*\({option.split()[0]}\)", message)
    assert message.code == code


def test_what_the_default_orbit_misses_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The part is 170 mm long; 150 mm off it, at 163.5 mm, the picture is 163.5 * 0.67 mm wide."""
    scene, file = folder_of("cylinder_paper") / "scene.xml", tmp_path / "a.nc"
    words = ["sweep", str(scene), "-o", str(file), "--azimuth=90", "--elevation=0"]
    assert main([*words, "-D", "scale=0.03"]) == 0
    said = capsys.readouterr().out.splitlines()[0]
    assert said.startswith("Of the part's side that faces the camera 35% is outside the picture on")
    assert "150 mm off the part; change this distance (--stand-off)" in said
    file.unlink()
    assert main([*words, "-D", "scale=0.03", "--stand-off=150"]) == 0
    assert "faces the camera" not in capsys.readouterr().out


def test_a_turntables_angle_is_stated(
    hot: HotBlock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As a column of the plan, and of the best pose; poses at all angles are of one series.

    The command of the plan runs as it was printed.
    """
    sweep = tmp_path / "a turned part.nc"
    words = ["sweep", str(hot.scene), "-o", str(sweep), "--turntable", "z:20:80:30"]
    assert main(words) == 0
    dataset = read_sweep(sweep)
    assert dataset["table"].values.tolist() == [20.0, 50.0, 80.0]
    command = re.search("now run:  iriftrace (.*)", capsys.readouterr().out)
    assert command
    assert main([*shlex.split(command[1]), "--min-hits", "1"]) == 0
    printed = capsys.readouterr().out
    best = summarise(dataset, Criteria(min_hits=1)).plan.best
    assert f"Best pose {best} (table's angle {dataset['table'].values[best]:g} deg)" in printed
    assert "table" in printed.split(), "the heading of a column"
    assert len(summarise(dataset, Criteria(min_hits=1)).series) == 1


def test_scenes_of_different_parts(fails: Failing, hot: HotBlock, tmp_path: Path) -> None:
    shutil.copytree(hot.scene.parent, tmp_path / "other")
    mesh = trimesh.load(tmp_path / "other" / "part.ply", process=False)
    mesh.apply_scale(0.9)
    mesh.export(tmp_path / "other" / "part.ply")
    message = fails(*f"sweep {hot.scene} other/scene.xml -o a.nc {ORBIT}".split())
    assert "other/part.ply" in message
    assert message.code == "sweep.different_parts"


def test_poses_in_the_part_are_recorded_as_failed(
    hot: HotBlock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A list is taken at its word: nothing is moved, and the other poses are rendered."""
    (tmp_path / "poses.csv").write_text(
        "x,y,z,target_x,target_y,target_z\n"
        "0,0,0.003,0,0,0\n0.06,-0.045,0.07,0,0,0\n0.06,0.045,0.07,0,0,0\n"
    )
    arguments = [str(hot.scene), "-o", str(tmp_path / "a.nc"), "--length-unit", "m"]
    assert main(["sweep", *arguments, "--poses", str(tmp_path / "poses.csv")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "2 with at least 100 good rays" in said
    assert "1 failed: The camera stands inside the part" in said
    dataset = read_sweep(tmp_path / "a.nc")
    assert [bool(text) for text in dataset["failure"].values] == [True, False, False]
    np.testing.assert_allclose(dataset["matrix"].values[1, :3, 3], (60.0, -45.0, 70.0))
    assert dataset["sightings"].values.tolist()[0] == 0
    assert np.isnan(dataset["stand_off"]).all()


def test_products_from_the_command_line(
    hot: HotBlock, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two fields, two focal lengths and two distances: eight times the orbit, in this order."""
    shutil.copytree(hot.scene.parent, tmp_path / "other")
    xml = tmp_path / "other" / "scene.xml"
    xml.write_text(xml.read_text().replace('value="gradient"', 'value="facet"'))
    output = tmp_path / "a.nc"
    line = (
        f"sweep {hot.scene} {xml} -o {output} {ORBIT} --focal-length 20mm,2.5cm "
        f"--stand-off 90,100mm --export {tmp_path / 'a.csv'} --surface {tmp_path / 'part.vtp'}"
    )
    assert main(line.split()) == 0
    dataset = read_sweep(output)
    assert dataset.sizes["pose"] == 16
    assert dataset["scene"].values.tolist() == [str(hot.scene)] * 8 + [str(xml)] * 8
    assert dataset["focal_length"].values.tolist() == ([20.0] * 4 + [25.0] * 4) * 2
    assert dataset["stand_off"].values.tolist() == [90.0, 90.0, 100.0, 100.0] * 4
    assert (tmp_path / "a.csv").is_file()
    assert (tmp_path / "part.vtp").is_file()
    # The longer lens sees the same faces with more rays.
    rays = dataset["rays_good"].sel(region="part").values.reshape(2, 2, 4)
    assert (rays[:, 1] > 1.3 * rays[:, 0]).all()
    assert "Part with the maps of all poses" in capsys.readouterr().out

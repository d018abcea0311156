"""The commands ``measure`` and ``correct``: a cloud through hot air, and without it."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv

from iriftrace.cli import main
from iriftrace.scenes import folder_of


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bundled cylinder with a projector 80 mm below its camera."""
    folder = tmp_path_factory.mktemp("fringe") / "cylinder"
    shutil.copytree(folder_of("cylinder"), folder)
    xml = folder / "scene.xml"
    text = xml.read_text()
    sensor = text[text.index("    <sensor") : text.index("    </sensor>") + len("    </sensor>\n")]
    projector = sensor.replace('id="camera"', 'id="projector"').replace("120.0", "40.0", 1)
    xml.write_text(text.replace(sensor, sensor + projector.replace("-0.461", "-0.0461")))
    return xml


@pytest.fixture(scope="module")
def scan(variant: str, scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    cloud = tmp_path_factory.mktemp("scan") / "scan.vtp"
    words = ["measure", str(scene), "-o", str(cloud), "-D", "scale=0.1"]
    assert main([*words, "--feature", "cylinder:lateral"]) == 0
    return cloud


def test_a_cloud_its_numbers_and_picture_are_written(scan: Path) -> None:
    values = json.loads(scan.with_suffix(".json").read_text())
    assert values["system"] == "fringe"
    assert values["points"]["measured"] == pv.read(scan).n_points > 5000
    (feature,) = values["features"]
    air_um = 1e3 * (feature["size_mm"]["cold"] - feature["size_mm"]["measured"])
    assert 1.0 < air_um < 50.0
    assert scan.with_suffix(".png").stat().st_size > 10_000


@pytest.mark.parametrize("suffix", [".vtp", ".xyz", ".ply"])
def test_its_correction_gives_the_diameter_back(
    scan: Path, scene: Path, suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever kind of file the cloud comes in."""
    import trimesh

    cloud = tmp_path / f"cloud{suffix}"
    points = np.asarray(pv.read(scan).points)
    if suffix == ".xyz":
        np.savetxt(cloud, points, header="x y z")
    elif suffix == ".ply":
        trimesh.PointCloud(points).export(cloud)
    else:
        shutil.copy(scan, cloud)
    target = tmp_path / "corrected.vtp"
    words = ["correct", str(cloud), str(scene), "-o", str(target), "-D", "scale=0.1"]
    assert main(words) == 0
    (corrected,) = json.loads(target.with_suffix(".json").read_text())["features"]
    (simulated,) = json.loads(scan.with_suffix(".json").read_text())["features"]
    # Found by itself; the heads are not seen.
    assert (corrected["kind"], corrected["region"]) == ("cylinder", "lateral")
    assert corrected["size_mm"]["corrected"] == pytest.approx(
        simulated["size_mm"]["cold"], abs=1e-4
    )
    assert "the air makes it" in capsys.readouterr().out


def test_rounded_coordinates_are_warned_of(
    scan: Path, scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud = tmp_path / "rounded.csv"
    np.savetxt(cloud, np.asarray(pv.read(scan).points).round(3), delimiter=",", fmt="%.3f")
    words = ["correct", str(cloud), str(scene), "-o", str(tmp_path / "out.vtp")]
    assert main([*words, "-D", "scale=0.1"]) == 0
    assert "rounded to 0.001 mm" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("no numbers at all\n", "holds no points"),
        ("1,2\n3,4\n", "has 2 columns"),
        ("1,2,3\n4,x,6\n", "far|cannot be read|beside the part"),
        ("0.001,0.002,0.0135\n" * 9, "beside the part"),
    ],
)
def test_wrong_clouds_end_in_one_sentence(
    scene: Path,
    rows: str,
    said: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    variant: str,
) -> None:
    cloud = tmp_path / "cloud.csv"
    cloud.write_text(rows)
    assert main(["correct", str(cloud), str(scene), "-o", str(tmp_path / "out.vtp")]) == 2
    error = capsys.readouterr().err
    assert "Traceback" not in error
    assert re.search(said, error)
    assert not (tmp_path / "out.vtp").exists()


def test_a_measured_cloud_is_not_replaced_by_its_correction(
    scan: Path, scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = scan.read_bytes()
    assert main(["correct", str(scan), str(scene), "-o", str(scan)]) == 2
    assert "which it is made from and which would be lost" in capsys.readouterr().err
    assert scan.read_bytes() == before


@pytest.mark.parametrize("command", ["measure", "correct", "render"])
def test_numbers_replace_no_file_of_the_users(
    command: str, scan: Path, scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As those of camera.ply would its calibration, camera.json; an earlier result they replace."""
    calibration, part = tmp_path / "camera.json", scene.parent / "part.ply"
    calibration.write_text('{"K": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}')
    before = calibration.read_bytes(), part.read_bytes()
    words = [command, *([str(scan)] if command == "correct" else []), str(scene)]
    small = ["-D", "scale=0.1", *([] if command == "correct" else ["--no-figures"])]
    ending = "exr" if command == "render" else "ply"
    assert main([*words, "-o", str(tmp_path / f"camera.{ending}"), *small]) == 2
    assert f"go to {calibration}, which is something else" in capsys.readouterr().err
    if command != "render":
        assert main([*words, "-o", str(part), *small]) == 2
        assert "would be lost" in capsys.readouterr().err
    assert (calibration.read_bytes(), part.read_bytes()) == before
    for _ in range(2):
        assert main([*words, "-o", str(tmp_path / f"new.{ending}"), *small]) == 0


def test_corners_of_an_stl_count_once(tmp_path: Path) -> None:
    import trimesh

    from iriftrace.triangulation.cloud import read_cloud

    trimesh.creation.icosphere(2).export(tmp_path / "ball.stl")
    with pytest.warns(UserWarning, match="does not say from which"):
        assert len(read_cloud(tmp_path / "ball.stl").points) == 162


def test_a_cloud_of_no_points_says_so(tmp_path: Path) -> None:
    from iriftrace.core.errors import InputError
    from iriftrace.triangulation.cloud import read_cloud

    empty = tmp_path / "empty.ply"
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    empty.write_text(f"ply\nformat ascii 1.0\nelement vertex 0\n{properties}end_header\n")
    with pytest.raises(InputError, match="holds no points"):
        read_cloud(empty)


def test_a_scene_with_one_device_is_refused(
    variant: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    xml = folder_of("slab") / "scene.xml"
    assert main(["measure", str(xml), "-o", str(tmp_path / "scan.vtp")]) == 2
    assert "no second device" in capsys.readouterr().err

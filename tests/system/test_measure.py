"""The commands ``measure`` and ``correct``: a cloud through hot air, and without it."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import trimesh
from failing import Failing

from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.io.clouds import read_cloud
from iriftrace.io.ply import write_ply_points
from iriftrace.scenes import folder_of
from scenes.generators.bundled import paper_copied
from validation.oracles.html_page import read_page


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The paper's view of the cylinder with a projector 80 mm below its camera."""
    xml = paper_copied(tmp_path_factory.mktemp("fringe") / "cylinder")
    text = xml.read_text()
    sensor = text[text.index("    <sensor") : text.index("    </sensor>") + len("    </sensor>\n")]
    projector = sensor.replace('id="camera"', 'id="projector"').replace("120.0", "40.0", 1)
    xml.write_text(text.replace(sensor, sensor + projector.replace("-0.461", "-0.0461")))
    return xml


@pytest.fixture(scope="module")
def scan(variant: str, scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    cloud = tmp_path_factory.mktemp("scan") / "scan.vtp"
    words = ["measure", str(scene), "-o", str(cloud), "-D", "scale=0.05"]
    assert main([*words, "--feature", "cylinder:lateral"]) == 0
    return cloud


def test_a_cloud_its_numbers_and_picture_are_written(scan: Path) -> None:
    values = json.loads(scan.with_suffix(".json").read_text())
    assert values["system"] == "fringe"
    assert values["points"]["measured"] == pv.read(scan).n_points > 1200
    (feature,) = values["features"]
    air_um = 1e3 * (feature["size_mm"]["cold"] - feature["size_mm"]["measured"])
    assert 1.0 < air_um < 50.0
    assert scan.with_suffix(".png").stat().st_size > 10_000


def test_its_correction_gives_the_diameter_back(
    scan: Path, scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of points alone; kinds of files are in tests/io."""
    cloud = tmp_path / "cloud.xyz"
    np.savetxt(cloud, np.asarray(pv.read(scan).points), header="x y z")
    target = tmp_path / "corrected.vtp"
    words = ["correct", str(cloud), str(scene), "-o", str(target), "-D", "scale=0.05"]
    assert main(words) == 0
    (corrected,) = json.loads(target.with_suffix(".json").read_text())["features"]
    (simulated,) = json.loads(scan.with_suffix(".json").read_text())["features"]
    # Found by itself; the heads are not seen.
    assert (corrected["kind"], corrected["region"]) == ("cylinder", "lateral")
    assert corrected["size_mm"]["corrected"] == pytest.approx(
        simulated["size_mm"]["cold"], abs=1e-4
    )
    assert re.search(r"Diameter of cylinder lateral, corrected: .*U = ", capsys.readouterr().out)


def test_a_cloud_moved_along_the_part_is_told_by_its_pixels(
    scan: Path, scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """5 mm along the cylinder, at which the camera looks obliquely; a pixel sees 1 mm."""
    cloud = pv.read(scan)
    assert {"pixel_u", "pixel_v"} <= set(cloud.point_data)
    words = [str(scene), "-o", str(tmp_path / "out.vtp"), "-D", "scale=0.05", "--no-figures"]
    assert main(["correct", str(scan), *words]) == 0
    assert "from their pixels" not in capsys.readouterr().err
    cloud.points[:, 0] += 5.0
    cloud.save(tmp_path / "moved.vtp")
    assert main(["correct", str(tmp_path / "moved.vtp"), *words]) == 0
    said = " ".join(capsys.readouterr().err.split())
    assert re.search(r"points lie [\d.]+ px \([345][\d.]* mm, medians\) from their pixels", said)


def test_rounded_coordinates_are_warned_of(
    scan: Path, scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cloud = tmp_path / "rounded.csv"
    np.savetxt(
        cloud, np.asarray(pv.read(scan).points).round(3), delimiter=",", fmt="%.3f", header="x,y,z"
    )
    words = ["correct", str(cloud), str(scene), "-o", str(tmp_path / "out.vtp")]
    assert main([*words, "-D", "scale=0.05"]) == 0
    assert "rounded to 0.001 mm" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("rows", "code", "said"),
    [
        ("no numbers at all\n", "file.damaged", "cloud.csv .*row of numbers"),
        ("1,2\n3,4\n", "table.columns", "cloud.csv .* 2 columns"),
        ("x,y,z\n1.5,2,3\n4,x,6\n", "file.damaged", "line 3: 'x'"),
        ("x,y,z\n" + "0.001,0.002,0.0135\n" * 9, "cloud.off_part", r" 13\.\d mm "),
    ],
)
def test_wrong_clouds_end_in_one_sentence(
    fails: Failing, scene: Path, tmp_path: Path, rows: str, code: str, said: str
) -> None:
    (tmp_path / "cloud.csv").write_text(rows)
    refusal = fails("correct", "cloud.csv", scene, "-o", "out.vtp")
    assert re.search(said, refusal)
    assert refusal.code == code


def test_wrong_files_end_in_one_sentence(
    fails: Failing, scan: Path, scene: Path, tmp_path: Path
) -> None:
    before = scan.read_bytes()
    refusal = fails("correct", scan, scene, "-o", scan)
    assert str(scan) in refusal
    assert refusal.code == "output.replaces"
    assert scan.read_bytes() == before
    slab = folder_of("slab") / "scene.xml"
    refusal = fails("measure", slab, "-o", "scan.vtp")
    assert re.search(r"slab/scene.xml .*\(--second of iriftrace scene\)", refusal)
    assert refusal.code == "devices.no_second"
    (tmp_path / "other.json").write_text('{"schema": "iriftrace.pose/1"}')
    (tmp_path / "part.json").write_text('{"schema": "iriftrace.scan/2", "points": {}}')
    for name, code in (("other", "report.no_numbers"), ("part", "file.damaged")):
        refusal = fails("report", f"{name}.json", "-o", "x.html")
        assert f"{name}.json" in refusal
        assert refusal.code == code


@pytest.mark.parametrize("command", ["measure", "correct", "render"])
def test_numbers_replace_no_file_of_the_users(
    command: str, scan: Path, scene: Path, tmp_path: Path, fails: Failing
) -> None:
    """As those of camera.ply would its calibration, camera.json; an earlier result they replace."""
    calibration, part = tmp_path / "camera.json", scene.parent / "part.ply"
    calibration.write_text('{"K": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}')
    before = calibration.read_bytes(), part.read_bytes()
    words = [command, *([str(scan)] if command == "correct" else []), str(scene)]
    small = ["-D", "scale=0.05", *([] if command == "correct" else ["--no-figures"])]
    ending = "exr" if command == "render" else "ply"
    refusal = fails(*words, "-o", tmp_path / f"camera.{ending}", *small)
    assert str(calibration) in refusal
    assert refusal.code == "output.replaces"
    if command != "render":
        refusal = fails(*words, "-o", part, *small)
        assert str(part) in refusal
        assert refusal.code == "output.replaces"
    assert (calibration.read_bytes(), part.read_bytes()) == before
    for _ in range(2 if command == "measure" else 1):
        assert main([*words, "-o", str(tmp_path / f"new.{ending}"), *small]) == 0


def test_corners_of_an_stl_count_once(tmp_path: Path) -> None:
    trimesh.creation.icosphere(2).export(tmp_path / "ball.stl")
    with pytest.warns(UserWarning, match="does not say from which"):
        assert len(read_cloud(tmp_path / "ball.stl").points) == 162


def test_a_cloud_of_no_points_says_so(tmp_path: Path) -> None:
    write_ply_points(tmp_path / "empty.ply", np.zeros((0, 3)), {})
    with pytest.raises(InputError, match=r"empty\.ply") as error:
        read_cloud(tmp_path / "empty.ply")
    assert error.value.code == "file.damaged"


def test_reports_of_a_measurement_and_its_correction(
    scan: Path,
    scene: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    fails: Failing,
) -> None:
    """One page each, with the numbers of its JSON, the picture, and all assumptions."""
    corrected = tmp_path / "c.csv"
    words = ["correct", str(scan), str(scene), "-o", str(corrected), "-D", "scale=0.05"]
    assert main([*words, "--uncertainty=air 5 %"]) == 0
    for cloud, true in ((scan, "cold"), (corrected, "corrected")):
        values = json.loads(cloud.with_suffix(".json").read_text())
        assert main(["report", str(cloud), "-o", str(tmp_path / "r.html")]) == 0
        page = read_page(tmp_path / "r.html")
        # A .csv is no cloud that is drawn in space.
        assert len(page.pictures) == 1 + (cloud is scan)
        assert min(map(len, page.pictures)) > 10_000
        (headings, row) = next(table for table in page.tables if table[0][0] == "feature")
        size = values["features"][0]["size_mm"]
        facts = dict(zip(headings, row, strict=True))
        assert facts["feature"] == "Cylinder (lateral)"
        assert facts["measured"] == f"{size['measured']:.4f} mm"
        assert facts[true] == f"{size[true]:.4f} mm"
        assert facts["air makes it"] == f"{1e3 * (size[true] - size['measured']):.3g} µm smaller"
        regions = next(table for table in page.tables if table[0][:3:2] == ["region", "measured"])
        assert [row[0] for row in regions[1:]] == ["lateral"]
        assert all(key.replace("_", " ") in page.by_id["setting"] for key in values["assumptions"])
    total = values["features"][0]["U_mm"]
    assert row[-1].startswith(f"{1e3 * total:.3g} µm (k = 2; ")
    outdated = values | {"schema": "iriftrace.correction/1"}
    corrected.with_suffix(".json").write_text(json.dumps(outdated))
    refusal = fails("report", corrected, "-o", tmp_path / "r.html")
    assert "'iriftrace.correction/1'" in refusal
    assert refusal.code == "file.schema"
    corrected.with_suffix(".json").write_text(json.dumps(values))
    corrected.with_suffix(".png").unlink()
    assert main(["report", str(corrected), "-o", str(tmp_path / "r.html")]) == 0
    assert "There is no picture" in capsys.readouterr().err


def test_the_hot_part_against_its_cold_drawing(
    scan: Path, scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """1.44 % larger is said to be steel at 1050 degC; sizes of an expanded part at 20 degC."""
    points = np.asarray(pv.read(scan).points)
    np.savetxt(tmp_path / "hot.xyz", 1.01442 * points, "%.6f")
    words = [str(scene), "-o", str(tmp_path / "c.vtp"), "-D", "scale=0.05", "--no-figures"]
    assert main(["correct", str(tmp_path / "hot.xyz"), *words]) == 0
    said, doubts = (" ".join(text.split()) for text in capsys.readouterr())
    assert re.search(r"The cloud is 1\.4\d % larger than the part .*--hot-temperature", doubts)
    assert "align the cloud" not in doubts
    assert "Sizes hold at the temperature that the part had" in said
    # The drawing of this part is 1 % smaller.
    file = tmp_path / "scene" / "part.ply"
    shutil.copytree(scene.parent, file.parent)
    state = b"comment thermal expansion 1e-05 /K from 293.15 K to 1293.15 K\nelement vertex"
    file.write_bytes(file.read_bytes().replace(b"element vertex", state, 1))
    words[0] = str(file.with_name("scene.xml"))
    tolerance = "--tolerance=cylinder:lateral=26.7 -0.1 0.1 mm"
    assert (
        main(["correct", str(scan), *words, "--uncertainty=expansion 2 %, part 10 K", tolerance])
        == 0
    )
    said = " ".join(capsys.readouterr().out.split())
    (row,) = json.loads((tmp_path / "c.json").read_text())["features"]
    cold, hot = row["value_mm"], row["size_mm"]["corrected"]
    assert cold == row["size_mm"]["drawing"] == pytest.approx(hot / 1.01, rel=1e-9)
    # 27 mm x (1000 K x 2e-7/K and 10 K x 1e-5/K in quadrature) / 1.01^2
    u = {part["group"]: part["u_mm"] for part in row["contributions"]}
    growth = "growth of the part"
    assert u[growth] == pytest.approx(hot * np.hypot(2e-4, 1e-4) / 1.01**2, rel=1e-6)
    assert row["U_mm"] == pytest.approx(2 * np.hypot(u[growth], u["sensor"]))
    assert row["not_covered"] == ["air around the part"]
    assert f", on the drawing at 20 degC: {cold:.3f} mm, U = at least {row['U_mm']:.3f} mm" in said
    assert row["decision"]["verdict"] == "not decided"
    assert "26.600 .. 26.800 mm: not decided (as measured, on the drawing: " in said
    assert "nothing is decided: solve the flow" in said
    assert main(["correct", str(scan), *words, "--uncertainty=part 10 K"]) == 0
    assert "not covered: air around the part, growth of the part" in " ".join(
        capsys.readouterr().out.split()
    )
    assert main(["correct", str(scan), *words, "--uncertainty=part 12 degC"]) == 2
    assert re.search("part is '12 degC'.* 10 K.*--uncertainty", capsys.readouterr().err)

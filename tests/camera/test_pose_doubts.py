"""Poses in another direction, convention or unit than read: said by the file, or by the part."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from iriftrace.camera.orbit import Orbit, orbit_poses
from iriftrace.camera.pose_files import read_poses, to_convention
from iriftrace.cli.pose_remedy import aimed_poses
from iriftrace.core.errors import InputError, IriftraceWarning

MATRICES = np.array(
    orbit_poses(Orbit((0, 0, 0), (300.0, 280.0, 250.0)), [20, 110, 200], [-30, 40]).matrices
)
SCENE = SimpleNamespace(
    part=SimpleNamespace(bounds=np.array(((-20.0, -13, -13), (20, 13, 13))), centre=np.zeros(3)),
    camera=SimpleNamespace(
        projection="perspective",
        sensor_mm=(6.7, 5.6),
        focal_length_mm=10.0,
        focal_px=(3650.0, 3650.0),
        focus_mm=(50.0, 400.0),
    ),
)


def in_metres(matrices, unit_mm=1000.0):
    scaled = matrices.copy()
    scaled[:, :3, 3] /= unit_mm
    return scaled


@pytest.mark.parametrize(
    "text",
    [
        json.dumps({"matrices": MATRICES.tolist(), "type": "world_to_camera"}),
        json.dumps({"w2c": MATRICES.tolist()}),
        json.dumps({"cam_from_world": MATRICES.tolist()}),
        *(
            f"# {said}\n" + "\n".join(" ".join(map(str, m.ravel())) for m in MATRICES)
            for said in ("T_cw", "cMo", "cam_T_object", "board2cam", "view matrix", "view_matrices")
        ),
        "# world -> camera\n" + "\n".join(" ".join(map(str, m.ravel())) for m in MATRICES),
    ],
)
def test_a_file_that_says_world_to_camera_is_refused(tmp_path, text):
    path = tmp_path / ("poses.json" if text.startswith("{") else "poses.txt")
    path.write_text(text)
    with pytest.raises(InputError, match="poses lead from the camera to the world"):
        read_poses(path)


@pytest.mark.parametrize("name", ["units", "lengthUnit", "translation_unit"])
def test_units_of_other_names_are_read(tmp_path, name):
    path = tmp_path / "poses.json"
    path.write_text(json.dumps({"matrices": in_metres(MATRICES).tolist(), name: "metre"}))
    assert_allclose(read_poses(path, length_unit="m").matrices, MATRICES)
    with pytest.raises(InputError, match="states length_unit 'm'"):
        read_poses(path)
    path = tmp_path / "poses.csv"
    rows = "".join(f"{x},{y},{z},0,0,0,m\n" for x, y, z in in_metres(MATRICES)[:, :3, 3])
    path.write_text(f"x,y,z,target_x,target_y,target_z,{name}\n{rows}")
    with pytest.raises(InputError, match="states length_unit 'm'"):
        read_poses(path)


@pytest.mark.parametrize(
    ("name", "stated", "options"),
    [
        ("convention", "OpenGL", {"convention": "opengl"}),
        ("length_unit", "Meter", {"length_unit": "m"}),
        ("unit", " MM", {}),
    ],
)
def test_what_a_file_states_may_be_in_capitals(tmp_path, name, stated, options):
    path = tmp_path / "poses.json"
    path.write_text(json.dumps({"matrices": MATRICES.tolist(), name: stated}))
    assert len(read_poses(path, **options)) == len(MATRICES)
    path = tmp_path / "poses.csv"
    path.write_text(f"x,y,z,qx,qy,qz,qw,{name}\n1,2,3,0,0,0,1,{stated}\n")
    assert len(read_poses(path, **options)) == 1


@pytest.mark.parametrize("remark", ["scale 1000", "left-handed", "axes: x right, y up", "in cm"])
def test_remarks_of_a_table_about_the_frame_are_warned_of(tmp_path, remark):
    path = tmp_path / "poses.csv"
    path.write_text(f"# {remark}\nx,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,1\n")
    with pytest.warns(IriftraceWarning, match=rf"entries that are not read \({remark}\)"):
        read_poses(path)


def test_a_remark_states_the_convention(tmp_path):
    path = tmp_path / "poses.csv"
    path.write_text("# convention: OpenGL\nx,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,1\n")
    with pytest.raises(InputError, match="states convention 'opengl'"):
        read_poses(path)
    assert len(read_poses(path, "opengl")) == 1


@pytest.mark.parametrize("name", ["roll", "up_x", "roll [deg]"])
def test_cameras_with_a_target_have_no_roll(tmp_path, name):
    path = tmp_path / "poses.csv"
    path.write_text(f"x,y,z,target_x,target_y,target_z,{name}\n100,0,0,0,0,0,10\n")
    with pytest.raises(InputError, match=r"states no roll, but has the columns (roll|up)"):
        read_poses(path)


@pytest.mark.parametrize("mark", [";", "\t"])
def test_decimal_commas_next_to_points_are_refused(tmp_path, mark):
    path = tmp_path / "poses.csv"
    rows = ["x;y;z;target_x;target_y;target_z", "1.234;12,5;3;0;0;0", "1,5;12,5;3;0;0;0"]
    path.write_text("\n".join(rows).replace(";", mark))
    with pytest.raises(InputError, match="has decimal commas and points"):
        read_poses(path)
    path.write_text("\n".join((rows[0], rows[2])).replace(";", mark))
    assert_allclose(read_poses(path).origins, [(1.5, 12.5, 3.0)])


def test_unread_entries_about_the_frame_are_warned_of(tmp_path):
    path = tmp_path / "poses.json"
    path.write_text(json.dumps({"matrices": MATRICES.tolist(), "coordinate_system": "opengl"}))
    with pytest.warns(
        IriftraceWarning, match=r"entries that are not read \(coordinate_system: opengl\)"
    ):
        read_poses(path)


@pytest.mark.parametrize("name", ["poses.json", "poses.npy", "poses.txt"])
def test_the_last_row_may_be_missing(tmp_path, name):
    path, rows = tmp_path / name, MATRICES[:, :3]
    match path.suffix:
        case ".json":
            path.write_text(json.dumps(rows.tolist()))
        case ".npy":
            np.save(path, rows)
        case _:
            np.savetxt(path, rows.reshape(-1, 12), fmt="%.17g")
    assert_allclose(read_poses(path).matrices, MATRICES)


@pytest.mark.parametrize(
    ("matrices", "remedy"),
    [
        (np.linalg.inv(MATRICES), r"with the inverse matrices \(from"),
        (to_convention(MATRICES, "opengl"), r"with --convention opengl\."),
        (to_convention(MATRICES, "ros"), r"with --convention ros\."),
        (
            in_metres(MATRICES),
            r"with --length-unit m\..* is 0.2\d\d mm .* and 2\d\d mm then; the focus is 50 to",
        ),
        (
            in_metres(MATRICES, 10.0),
            r"with --length-unit cm\..* is 2\d.\d mm .* and 2\d\d mm then; the focus is 50 to",
        ),
        (in_metres(MATRICES, 25.4), r"with --length-unit cm\..* and 1\d\d mm then"),
        (in_metres(np.linalg.inv(MATRICES)), "with --length-unit m and the inverse matrices"),
    ],
)
def test_poses_that_look_elsewhere_are_refused_with_the_remedy(tmp_path, matrices, remedy):
    np.save(tmp_path / "poses.npy", matrices)
    with pytest.raises(InputError, match=f"do not look at the part, but all would {remedy}"):
        aimed_poses(tmp_path / "poses.npy", SCENE, "opencv", "mm", None, {})


def test_few_poses_that_look_at_the_part_by_chance_are_warned_of(tmp_path):
    angles = Rotation.from_matrix(MATRICES[:, :3, :3]).as_euler("ZYX", degrees=True)
    # Kuka's and Mitsubishi's angles of one rotation are the same if only one is not zero.
    rows = [(*matrix[:3, 3], *angle) for matrix, angle in zip(MATRICES, angles, strict=True)]
    rows.append((0.0, 0.0, -300.0, 0.0, 0.0, 0.0))
    np.savetxt(tmp_path / "poses.csv", rows, delimiter=",", header="x,y,z,a,b,c", comments="")
    file = tmp_path / "poses.csv"
    assert len(aimed_poses(file, SCENE, "opencv", "mm", "kuka", {})) == len(rows)
    with pytest.warns(IriftraceWarning, match=r"Only \d of the 7 .* all would with --robot kuka"):
        aimed_poses(file, SCENE, "opencv", "mm", "mitsubishi", {})


def test_motions_of_the_robot_the_other_way_round_are_noticed(tmp_path):
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_euler("ZYX", (70, 50, 30), degrees=True).as_matrix()
    turn[:3, 3] = 80.0, 10.0, -40.0
    base = np.eye(4)
    base[:3, 3] = -900.0, 200.0, -350.0
    file = tmp_path / "flange.npy"
    np.save(file, np.linalg.inv(base) @ MATRICES @ np.linalg.inv(turn))
    frames = {"hand_eye": turn, "base_to_part": base}
    assert_allclose(
        aimed_poses(file, SCENE, "opencv", "mm", None, frames).matrices, MATRICES, atol=1e-9
    )
    for name, wrong, remedy in (
        ("hand_eye", np.linalg.inv(turn), "the inverse of --hand-eye"),
        ("base_to_part", np.linalg.inv(base), "the inverse of --base-to-part"),
        ("base_to_part", in_metres(base[None])[0], "the translation in --base-to-part in m"),
    ):
        with pytest.raises((InputError, IriftraceWarning), match=f"all would with {remedy}"):
            aimed_poses(file, SCENE, "opencv", "mm", None, {**frames, name: wrong})


def test_poses_that_look_past_the_part_in_every_way_are_kept(tmp_path):
    beside = MATRICES.copy()
    beside[:, :3, 3] += 1e4
    np.save(tmp_path / "poses.npy", beside)
    assert len(aimed_poses(tmp_path / "poses.npy", SCENE, "opencv", "mm", None, {})) == 6

"""Pose files: conventions by hand and there and back, every file form, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as stn
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from iriftrace.camera.orbit import Orbit, orbit_poses
from iriftrace.camera.pose import look_at
from iriftrace.camera.pose_set import PoseSet
from iriftrace.core.errors import InputError
from iriftrace.io.poses import (
    CONVENTIONS,
    SCHEMA,
    from_convention,
    read_poses,
    to_convention,
    write_poses,
)
from iriftrace.plugins.kernels.projection import flip_axes

POSES = orbit_poses(Orbit((1.0, 2.0, 3.0), (225.0, 150.0, 100.0)), [0.1, 33.3, 200.0], [-90.0, 0.3])

DATA = Path(__file__).parents[1] / "data" / "poses"
NINE = "x,y,z,qx,qy,qz,qw"
SIXTEEN = ",".join(f"m{row}{column}" for row in range(4) for column in range(4))
IDENTITY = "1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1"

quaternions = stn.arrays(np.float64, 4, elements=st.floats(-1.0, 1.0)).filter(
    lambda q: np.linalg.norm(q) > 0.1
)
positions = stn.arrays(np.float64, 3, elements=st.floats(-1e4, 1e4))


def pose(quaternion, position):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(quaternion).as_matrix()
    matrix[:3, 3] = position
    return matrix


def written(folder, text, name="poses.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


# A camera at (10, 20, 30) mm that looks along world +x with +z up: its right is world -y.
RIGHT, UP, FORWARD = np.array((0, -1, 0)), np.array((0, 0, 1)), np.array((1, 0, 0))
LEVEL = look_at((10.0, 20.0, 30.0), (11.0, 20.0, 30.0))


@pytest.mark.parametrize(
    ("name", "x", "y", "z"),
    [
        ("opencv", RIGHT, -UP, FORWARD),
        ("mitsuba", -RIGHT, UP, FORWARD),
        ("opengl", RIGHT, UP, -FORWARD),
        ("ros", FORWARD, -RIGHT, UP),
    ],
)
def test_axes_by_hand(name, x, y, z):
    matrix = to_convention(LEVEL, name)
    assert_array_equal(matrix[:3, :3], np.stack((x, y, z), axis=1))
    assert_array_equal(matrix[:, 3], (10, 20, 30, 1))
    assert_array_equal(from_convention(matrix, name), LEVEL)


def test_cameras_at_rest():
    # x forward, y left, z up: a ROS robot that has not turned has the identity as its pose.
    assert_array_equal(to_convention(look_at((0, 0, 0), (1, 0, 0)), "ros"), np.eye(4))
    # A Blender camera looks down with y up.
    matrix = from_convention(np.eye(4), "opengl")
    assert_array_equal(matrix[:3, 2], (0, 0, -1))
    assert_array_equal(-matrix[:3, 1], (0, 1, 0))


def test_mitsubas_axes_are_those_of_the_plugins():
    assert_array_equal(to_convention(POSES.matrices, "mitsuba"), flip_axes(POSES.matrices))


@given(quaternions, positions, st.sampled_from(sorted(CONVENTIONS)))
def test_conventions_there_and_back_change_no_bit(quaternion, position, name):
    matrix = pose(quaternion, position)
    other = to_convention(matrix, name)
    assert_array_equal(from_convention(other, name), matrix)
    assert np.linalg.det(other[:3, :3]) == pytest.approx(1.0)
    assert_array_equal(to_convention([[matrix]], name), [[other]])


def test_an_unknown_convention(tmp_path):
    message = "Unknown camera convention 'unity'; use one of opencv, mitsuba, opengl, ros"
    for action in (
        lambda: to_convention(LEVEL, "unity"),
        lambda: from_convention(LEVEL, "unity"),
        lambda: read_poses(tmp_path / "any.csv", "unity"),
        lambda: write_poses(tmp_path / "out.csv", POSES, "unity"),
    ):
        with pytest.raises(InputError, match=message):
            action()
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("ending", [".csv", ".json", ".npy"])
@pytest.mark.parametrize("convention", CONVENTIONS)
def test_files_give_poses_back_to_the_last_bit(tmp_path, ending, convention):
    path = tmp_path / f"poses{ending}"
    write_poses(path, POSES, convention)
    back = read_poses(path, convention)
    assert_array_equal(back.matrices, POSES.matrices)
    kept = ending in (".csv", ".json")
    assert_array_equal(back.azimuth_deg, POSES.azimuth_deg if kept else np.full(4, np.nan))
    assert_array_equal(back.elevation_deg, POSES.elevation_deg if kept else np.full(4, np.nan))


@given(st.lists(st.tuples(quaternions, positions, st.floats(-90.0, 90.0)), min_size=1, max_size=3))
def test_any_pose_survives_a_table(tmp_path_factory, listed):
    path = tmp_path_factory.mktemp("poses") / "poses.csv"
    matrices = np.array([pose(quaternion, position) for quaternion, position, _ in listed])
    # Half of the angles are known.
    poses = PoseSet(matrices, [angle for _, _, angle in listed])
    write_poses(path, poses, "ros")
    back = read_poses(path, "ros")
    assert_array_equal(back.origins, matrices[:, :3, 3])
    # scipy's own matrices are orthonormal to some 1e-16, so reading mends nothing.
    assert_array_equal(back.matrices, matrices)
    assert_array_equal(back.azimuth_deg, poses.azimuth_deg)
    assert np.isnan(back.elevation_deg).all()


def test_a_file_that_states_its_convention_or_unit_is_not_read_with_another(tmp_path):
    for path in (tmp_path / "poses.csv", tmp_path / "poses.json"):
        write_poses(path, POSES, "opengl")
        with pytest.raises(InputError, match="states the convention 'opengl', but is read with"):
            read_poses(path)
    with pytest.raises(InputError, match="states the length unit 'mm', but is read with 'm'"):
        read_poses(tmp_path / "poses.json", "opengl", length_unit="m")


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = written(tmp_path, "old")
    with pytest.raises(InputError, match="no pose to write"):
        write_poses(path, POSES.take([]))
    assert path.read_text() == "old"
    with pytest.raises(InputError, match=r"ends in \.csv, \.json, \.npy"):
        write_poses(tmp_path / "poses.txt", POSES)
    with pytest.raises(InputError, match="does not exist"):
        write_poses(tmp_path / "missing" / "poses.csv", POSES)


SHIFTED = np.array([(1, 0, 0, 1.5), (0, 1, 0, -2), (0, 0, 1, 3), (0, 0, 0, 1)])


@pytest.mark.parametrize(
    "text",
    [
        f"{SIXTEEN}\n1,0,0,1.5,0,1,0,-2,0,0,1,3,0,0,0,1\n",
        f"\ufeff{SIXTEEN},convention\r\n1,0,0,1.5,0,1,0,-2,0,0,1,3,0,0,0,1,OpenCV\r\n\r\n",
        # A spreadsheet in a country of decimal commas.
        f"{SIXTEEN}\n1,0,0,1.5,0,1,0,-2,0,0,1,3,0,0,0,1\n".replace(",", ";").replace(".", ","),
        'x,"y",z,qx,qy,qz,qw\n1.5,-2,3,0,0,0,1\n',
        "qw,qx,qy,qz,X [MM],Y [MM],Z [MM]\n-1,0,0,0,1.5,-2,3\n",
        "x,y,z,target_x,target_y,target_z,azimuth_deg\n1.5,-2,3,1.5,-2,4,12\n",
    ],
)
def test_forms_of_a_table(tmp_path, text):
    poses = read_poses(written(tmp_path, text))
    expected = SHIFTED.copy()
    if "target" in text:
        # Straight up, the x-axis is +y: the limit of azimuth 0 below the part.
        expected[:3, :3] = np.stack(((0, 1, 0), (-1, 0, 0), (0, 0, 1)), axis=1)
        assert_array_equal(poses.azimuth_deg, [12])
    assert_array_equal(poses.matrices, [expected])


def test_quaternions_of_a_sample():
    still, turned = read_poses(DATA / "optical_frames.csv").matrices
    assert_array_equal(still, SHIFTED)
    # A third of a turn about the diagonal: the camera's x, y and z look along world y, z and x.
    assert_allclose(turned[:3, :3].T, ((0, 1, 0), (0, 0, 1), (1, 0, 0)), atol=1e-15)


def test_arrays(tmp_path):
    np.save(tmp_path / "poses.npy", [SHIFTED, np.eye(4)])
    assert_array_equal(read_poses(tmp_path / "poses.npy").matrices, [SHIFTED, np.eye(4)])


def test_quaternions_have_the_scalar_last_and_the_files_convention(tmp_path):
    # A quarter turn about z, (0, 0, sin 45, cos 45): a ROS body that looks along world +y.
    half = 0.5**0.5
    path = written(tmp_path, f"x,y,z,qx,qy,qz,qw\n0,0,0,0,0,{half},{half}\n")
    matrix = read_poses(path, "ros").matrices[0]
    assert_allclose(matrix, look_at((0, 0, 0), (0, 1, 0)), atol=1e-15)


def test_targets_mean_the_same_in_every_convention_and_unit(tmp_path):
    path = written(tmp_path, "x,y,z,target_x,target_y,target_z\n1,2,3,-50,20,0\n")
    for convention in CONVENTIONS:
        matrix = read_poses(path, convention).matrices[0]
        assert_allclose(matrix, look_at((1, 2, 3), (-50, 20, 0)), atol=1e-14)
    assert_array_equal(read_poses(path, length_unit="m").origins, [(1000, 2000, 3000)])
    path = written(tmp_path, f"{SIXTEEN}\n{IDENTITY.replace('1,0,0,0', '1,0,0,0.25', 1)}")
    assert_array_equal(read_poses(path, length_unit="m").origins, [(250, 0, 0)])


@given(quaternion=quaternions)
def test_rotations_printed_with_four_digits_are_mended(tmp_path_factory, quaternion):
    matrix = pose(quaternion, (1.0, 2.0, 3.0))
    path = tmp_path_factory.mktemp("poses") / "robot.csv"
    np.savetxt(path, matrix.reshape(1, 16), "%.4f", ",", header=SIXTEEN, comments="")
    axes = read_poses(path).matrices[0, :3, :3]
    assert_allclose(axes.T @ axes, np.eye(3), atol=1e-14)
    # The nearest rotation is no farther from the printed entries (5e-5 each) than the true one.
    assert np.linalg.norm(axes - matrix[:3, :3]) <= 2 * 3 * 5e-5


@pytest.mark.parametrize(
    "header",
    [
        "x,y,z,roll,pitch,yaw",
        "# x,y,z,qx,qy,qz,qw",
        "x,y,z,q1,q2,q3,q4",
        "x,y,z,qx,qy,qz,qw,target_x,target_y,target_z",
        # Each of these could change what the poses mean, and is not read.
        f"{NINE},unit",
        f"{NINE},frame",
        f"{NINE},x",
        "x,y,z,target_x,target_y,target_z,roll",
        "tx,ty,tz,qx,qy,qz,qw",
        "x_mm,y_mm,z_mm,qx,qy,qz,qw",
        "x,y,z,qx [m],qy,qz,qw",
        f"{SIXTEEN.replace('m03', 'm03 [mm]')}",
        # The first of rows without names, and of a file of another program.
        IDENTITY,
        "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1",
        "# Image list with two lines of data per image:",
    ],
)
def test_other_columns_are_refused_with_what_was_found(tmp_path, header):
    row = ",".join("0" * (header.count(",") + 1))
    path = written(tmp_path, f"{header}\n{row}\n")
    with pytest.raises(InputError) as caught:
        read_poses(path)
    assert repr(header) in str(caught.value)
    one_sentence(caught.value, path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no pose below"),
        (NINE, "no pose below"),
        (f"{NINE}\n0,0,0,0,0,1", "line 2 has 6 columns, but the first one names 7"),
        (f"{NINE}\n0,0,0,0,0,0,one", "line 2: 'one' is not a number"),
        (f"{NINE}\n0,0,0,0,0,0,", "line 2: '' is not a number"),
        (f"{NINE}\n0,0,0,0,0,0,2", "line 2: the quaternion has length 2 instead of 1"),
        (f"{NINE}\n0,0,0,0,0,0,nan", "line 2: the quaternion has length nan"),
        (f"{NINE}\n0,inf,0,0,0,0,1", "Pose 1 of .* not finite"),
        # Of points and commas in one table, either may be the decimal sign.
        (f"{NINE}\n1.234,5,0,0,0,0,1".replace(",", ";").replace(";5", ",5;0"), "line 2"),
        (
            "x,y,z,target_x,target_y,target_z\n1,2,3,1,2,3",
            r"\[1.0, 2.0, 3.0\] mm stands on its own target",
        ),
        (f"{SIXTEEN}\n{IDENTITY}\n{IDENTITY},5", "line 3 has 17 columns"),
        (f"{SIXTEEN}\n{IDENTITY.replace('1', '2')}", "Pose 1 of .* 0 0 0 1"),
        (f"{SIXTEEN}\n1,0,0,0,0,1,0,0,0,0,1,0,5,6,7,1", r"is the matrix transposed\?$"),
        (
            f"{SIXTEEN}\n{IDENTITY}\n2,0,0,0,0,2,0,0,0,0,2,0,0,0,0,1",
            "Pose 2 of .* remove scale and shear",
        ),
        (f"{SIXTEEN}\n1,0,0,0,0,1,0,0,0,0,-1,0,0,0,0,1", "Pose 1 of .* mirrors the picture"),
        (f"{NINE},azimuth_deg\n0,0,0,0,0,0,1,east", "line 2: 'east' is not a number"),
        (f"{NINE},convention\n0,0,0,0,0,0,1,ros", "states the convention 'ros'"),
        (f"{NINE},convention\n0,0,0,0,0,0,1,ros\n0,0,0,0,0,0,1,opencv", "'opencv, ros'"),
        (f"{NINE.replace('x,', 'x [m],', 1)}\n0,0,0,0,0,0,1", "states the length unit 'm'"),
        (f"{NINE.replace('x,', 'x [feet],', 1)}\n0,0,0,0,0,0,1", "states the length unit 'feet'"),
    ],
)
def test_malformed_tables(tmp_path, text, message):
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        read_poses(path)
    one_sentence(caught.value, path)


def test_a_unit_that_a_table_states_must_be_the_one_it_is_read_in(tmp_path):
    path = written(tmp_path, "x [m],y [m],z [m],qx,qy,qz,qw\n1,2,3,0,0,0,1\n")
    assert_array_equal(read_poses(path, length_unit="m").origins, [(1000, 2000, 3000)])
    with pytest.raises(InputError, match="states the length unit 'm', but is read with 'mm'"):
        read_poses(path)


FILE = {
    "schema": SCHEMA,
    "convention": "opencv",
    "length_unit": "mm",
    "matrices": [np.eye(4).tolist()],
    "azimuth_deg": [None],
    "elevation_deg": [4.0],
}


def test_a_json_file_of_ours(tmp_path):
    poses = read_poses(written(tmp_path, json.dumps(FILE), "poses.json"))
    assert_array_equal(poses.matrices, [np.eye(4)])
    assert_array_equal(poses.azimuth_deg, [np.nan])
    assert_array_equal(poses.elevation_deg, [4])


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[[1, 2",
        "[" * 100_000,
        "{}",
        "5",
        # Matrices alone do not say whose axes and units they have.
        json.dumps(FILE["matrices"]),
        json.dumps({"matrices": FILE["matrices"], "type": "world_to_camera"}),
        json.dumps({**FILE, "schema": "iriftrace.poses/2"}),
        *(json.dumps({name: FILE[name] for name in FILE if name != left}) for left in FILE),
        json.dumps({**FILE, "matrices": None}),
        json.dumps({**FILE, "matrices": []}),
        json.dumps({**FILE, "matrices": [[[1.0, 2.0], [3.0]]]}),
        json.dumps({**FILE, "matrices": [np.eye(3).tolist()]}),
        json.dumps({**FILE, "matrices": [np.diag((1.0, 1.0, 1.0, np.nan)).tolist()]}),
        json.dumps({**FILE, "azimuth_deg": [1.0, 2.0]}),
        json.dumps({**FILE, "elevation_deg": "up"}),
        json.dumps({**FILE, "convention": 5}),
        json.dumps({**FILE, "convention": "opengl"}),
        json.dumps({**FILE, "length_unit": "m"}),
    ],
)
def test_malformed_json(tmp_path, text):
    path = written(tmp_path, text, "poses.json")
    with pytest.raises(InputError) as caught:
        read_poses(path)
    one_sentence(caught.value, path)


def test_malformed_and_other_arrays(tmp_path):
    path = tmp_path / "poses.npy"
    for content in (b"", b"no array", b"PK\x03\x04 no archive", b"\x93NUMPY\x01\x00"):
        path.write_bytes(content)
        with pytest.raises(InputError, match="4x4 camera-to-world matrices") as caught:
            read_poses(path)
        one_sentence(caught.value, path)
    for shape in ((3, 5), (4, 4), (2, 3, 4), (2, 16), (0, 4, 4)):
        np.save(path, np.zeros(shape))
        with pytest.raises(InputError) as caught:
            read_poses(path)
        assert str(shape) in str(caught.value)
    np.save(path, np.array([{"pickled": 1}]), allow_pickle=True)
    with pytest.raises(InputError, match="4x4 camera-to-world matrices"):
        read_poses(path)


def test_files_that_are_not_there_or_of_another_format(tmp_path):
    with pytest.raises(InputError, match="There is no file"):
        read_poses(tmp_path / "missing.csv")
    (tmp_path / "folder.npy").mkdir()
    with pytest.raises(InputError, match="There is no file"):
        read_poses(tmp_path / "folder.npy")
    for name in ("poses.txt", "kuka.src", "robot.ls", "folder"):
        with pytest.raises(InputError, match=r"ends in \.csv, \.json, \.npy"):
            read_poses(tmp_path / name)
    picture = tmp_path / "picture.csv"
    picture.write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR")
    with pytest.raises(InputError) as caught:
        read_poses(picture)
    one_sentence(caught.value, picture)


def one_sentence(error, path):
    """The message names the file, is one line and ends like a sentence."""
    text = str(error)
    assert str(path) in text
    assert "\n" not in text
    assert text.endswith((".", "?"))

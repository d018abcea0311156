"""Pose files: conventions by hand and there and back, every file form, and what is refused."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as stn
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from iriftrace.camera.orbit import Orbit, orbit_poses
from iriftrace.camera.pose import look_at
from iriftrace.camera.pose_files import (
    CONVENTIONS,
    from_convention,
    read_poses,
    to_convention,
    write_poses,
)
from iriftrace.camera.pose_set import PoseSet
from iriftrace.core.errors import InputError
from iriftrace.plugins.kernels.projection import flip_axes

POSES = orbit_poses(Orbit((1.0, 2.0, 3.0), (225.0, 150.0, 100.0)), [0.1, 33.3, 200.0], [-90.0, 0.3])

IDENTITY = "1 0 0 0  0 1 0 0  0 0 1 0  0 0 0 1"

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
        lambda: read_poses(written(tmp_path, IDENTITY), "unity"),
        lambda: write_poses(tmp_path / "out.csv", POSES, "unity"),
    ):
        with pytest.raises(InputError, match=message):
            action()
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("ending", [".csv", ".json", ".npy", ".txt"])
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
        with pytest.raises(InputError, match="states convention 'opengl', but is read with 'open"):
            read_poses(path)
    with pytest.raises(InputError, match="states length_unit 'mm', but is read with 'm'"):
        read_poses(tmp_path / "poses.json", "opengl", length_unit="m")


def test_a_failed_write_leaves_the_old_file(tmp_path):
    path = written(tmp_path, "old", "poses.txt")
    with pytest.raises(InputError, match="no pose to write"):
        write_poses(path, POSES.take([]))
    assert path.read_text() == "old"
    with pytest.raises(InputError, match=r"ending .* use \.csv, \.txt"):
        write_poses(tmp_path / "poses.xml", POSES)
    with pytest.raises(InputError, match="does not exist"):
        write_poses(tmp_path / "missing" / "poses.csv", POSES)


SHIFTED = np.array([(1, 0, 0, 1.5), (0, 1, 0, -2), (0, 0, 1, 3), (0, 0, 0, 1)])


@pytest.mark.parametrize(
    "text",
    [
        "1 0 0 1.5  0 1 0 -2  0 0 1 3  0 0 0 1",
        "1,0,0,1.5,0,1,0,-2,0,0,1,3,0,0,0,1\n",
        "1;0;0;1,5;0;1;0;-2;0;0;1;3;0;0;0;1\r\n",  # a spreadsheet in a country of decimal commas
        "\ufeff# from the robot\n1 0 0 1.5 # first\n0 1 0 -2\n\n0 0 1 3\n0 0 0 1\n",
        "1, 0, 0, 1.5\n0, 1, 0, -2\n0, 0, 1, 3\n0, 0, 0, 1\n",
        'x,"y",z,qx,qy,qz,qw\n1.5,-2,3,0,0,0,1\n',
        "qw\tqx\tqy\tqz\tx\ty\tz\n-1\t0\t0\t0\t1.5\t-2\t3\n",
        "name,X,Y,Z,QX,QY,QZ,QW\nfirst view,1.5,-2,3,0,0,0,1\n",
        "x y z target_x target_y target_z azimuth_deg\n1.5 -2 3 1.5 -2 4 12\n",
    ],
)
def test_text_forms(tmp_path, text):
    poses = read_poses(written(tmp_path, text))
    expected = SHIFTED.copy()
    if "target" in text:
        # Straight up, the x-axis is +y: the limit of azimuth 0 below the part.
        expected[:3, :3] = np.stack(((0, 1, 0), (-1, 0, 0), (0, 0, 1)), axis=1)
        assert_array_equal(poses.azimuth_deg, [12])
    assert_array_equal(poses.matrices, [expected])


@pytest.mark.parametrize(
    "data",
    [
        SHIFTED.tolist(),
        [SHIFTED.tolist()],
        SHIFTED.ravel().tolist(),
        [SHIFTED.ravel().tolist()],
        {"matrices": [SHIFTED.tolist()], "azimuth_deg": [None], "elevation_deg": [4], "by": "hand"},
    ],
)
def test_json_and_array_forms(tmp_path, data):
    poses = read_poses(written(tmp_path, json.dumps(data), "poses.json"))
    assert_array_equal(poses.matrices, [SHIFTED])
    if isinstance(data, dict):
        assert_array_equal(poses.elevation_deg, [4])
    else:
        np.save(tmp_path / "poses.npy", np.array(data))
        assert_array_equal(read_poses(tmp_path / "poses.npy").matrices, [SHIFTED])


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
    path = written(tmp_path, IDENTITY.replace("1 0 0 0", "1 0 0 0.25", 1))
    assert_array_equal(read_poses(path, length_unit="m").origins, [(250, 0, 0)])


@given(quaternion=quaternions)
def test_rotations_printed_with_four_digits_are_mended(tmp_path_factory, quaternion):
    matrix = pose(quaternion, (1.0, 2.0, 3.0))
    path = tmp_path_factory.mktemp("poses") / "robot.txt"
    np.savetxt(path, matrix, fmt="%.4f")
    axes = read_poses(path).matrices[0, :3, :3]
    assert_allclose(axes.T @ axes, np.eye(3), atol=1e-14)
    # The nearest rotation is no farther from the printed entries (5e-5 each) than the true one.
    assert np.linalg.norm(axes - matrix[:3, :3]) <= 2 * 3 * 5e-5


NINE = "x,y,z,qx,qy,qz,qw"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "holds no pose"),
        ("# nothing but a comment\n\n", "holds no pose"),
        (NINE, "has a header but no pose below it"),
        ("1,2,3,4,5,6", "6 numbers a row and no header, which has no one meaning"),
        ("0,0,0,0,0,0,1", "7 numbers a row and no header"),
        (f"{NINE}\n0,0,0,0,0,1", "line 2 has 6 columns, but the first row has 7"),
        (f"{NINE}\n0,0,0,0,0,0,one", "line 2: 'one' is not a number"),
        (f"{NINE}\n0,0,0,0,0,0,", "line 2: '' is not a number"),
        (f"{NINE}\n0,0,0,0,0,0,2", "line 2: the quaternion has length 2 instead of 1"),
        (f"{NINE}\n0,0,0,0,0,0,nan", "line 2: the quaternion has length nan"),
        (f"{NINE}\n0,inf,0,0,0,0,1", "Pose 1 of .* not finite"),
        (f"{NINE},x\n0,0,0,0,0,0,1,0", "has the column x twice"),
        ("x,y,z,roll,pitch,yaw\n0,0,0,0,0,0", "does not describe poses; name the columns"),
        (
            f"{NINE},target_x,target_y,target_z\n0,0,0,0,0,0,1,1,1,1",
            "describes poses twice; name the columns",
        ),
        (
            "x,y,z,target_x,target_y,target_z\n1,2,3,1,2,3",
            r"\[1.0, 2.0, 3.0\] mm stands on its own target",
        ),
        (
            "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ\n1 1 0 0 0 1 2 3",
            "is COLMAP.s list of images",
        ),
        ("1 0 0 0\n0 1 0 0\n0 0 1 0", "3 rows of 4 numbers, but 4x4 matrices need four rows"),
        (f"{IDENTITY}\n{IDENTITY} 5", "line 2 has 17 columns"),
        (IDENTITY.replace("1", "2"), "Pose 1 of .* 0 0 0 1"),
        ("1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1", r"is the matrix transposed\?$"),
        (f"{IDENTITY}\n2 0 0 0 0 2 0 0 0 0 2 0 0 0 0 1", "Pose 2 of .* remove scale and shear"),
        ("1 0 0 0 0 1 0 0 0 0 -1 0 0 0 0 1", "Pose 1 of .* mirrors the picture"),
        (IDENTITY.replace("1", "one", 1), "line 1: 'one' is not a number"),
        (f"{NINE},azimuth_deg\n0,0,0,0,0,0,1,east", "'east' is not a number"),
        (f"{NINE},convention\n0,0,0,0,0,0,1,ros", "states convention 'ros'"),
    ],
)
def test_malformed_tables(tmp_path, text, message):
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        read_poses(path)
    one_sentence(caught.value, path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is not valid JSON"),
        ("[[1, 2", "is not valid JSON"),
        ("[" * 100_000, "is not valid JSON"),
        ("{}", "has no entry 'matrices'"),
        ("[]", "holds no list of 4x4 matrices"),
        ("5", "holds no list of 4x4 matrices"),
        ('"poses"', "holds no list of 4x4 matrices"),
        ("[[1, 2, 3], [4, 5]]", "holds no list of 4x4 matrices"),
        ('[[{"x": 1}]]', "holds no list of 4x4 matrices"),
        ('{"matrices": null}', "holds no list of 4x4 matrices"),
        (json.dumps({"matrices": [np.eye(4).tolist()], "azimuth_deg": [1, 2]}), "'azimuth_deg' is"),
        (json.dumps({"matrices": [np.eye(4).tolist()], "elevation_deg": "up"}), "'elevation_deg'"),
        (json.dumps({"matrices": [np.eye(4).tolist()], "convention": 5}), "states convention 5"),
        (json.dumps({"matrices": np.eye(4).tolist(), "units": "meters"}), "length_unit 'm'"),
        ('{"matrices": [], "matrices": []}', "has matrices twice; leave out"),
        (json.dumps([np.diag((1.0, 1.0, 1.0, np.nan)).tolist()]), "not finite"),
    ],
)
def test_malformed_json(tmp_path, text, message):
    path = written(tmp_path, text, "poses.json")
    with pytest.raises(InputError, match=message) as caught:
        read_poses(path)
    one_sentence(caught.value, path)


def test_malformed_and_other_arrays(tmp_path):
    path = tmp_path / "poses.npy"
    for content in (b"", b"no array", b"PK\x03\x04 no archive", b"\x93NUMPY\x01\x00"):
        path.write_bytes(content)
        with pytest.raises(InputError, match="is not a NumPy array") as caught:
            read_poses(path)
        one_sentence(caught.value, path)
    np.save(path, np.zeros((3, 5)))
    with pytest.raises(InputError, match="holds no list of 4x4 matrices"):
        read_poses(path)
    np.save(path, np.array([{"pickled": 1}]), allow_pickle=True)
    with pytest.raises(InputError, match="is not a NumPy array"):
        read_poses(path)


def test_files_that_are_not_there_or_not_text(tmp_path):
    with pytest.raises(InputError, match=r"cannot read poses from .*: No such file"):
        read_poses(tmp_path / "missing.csv")
    with pytest.raises(InputError, match="cannot read poses from"):
        read_poses(tmp_path)
    picture = tmp_path / "picture.png"
    picture.write_bytes(b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR")
    with pytest.raises(InputError, match="is not text"):
        read_poses(picture)


def one_sentence(error, path):
    """The message names the file, is one line and ends like a sentence."""
    text = str(error)
    assert str(path) in text
    assert "\n" not in text
    assert text.endswith((".", "?"))


@pytest.mark.parametrize(
    "header",
    [
        "x_mm,y_mm,z_mm,qx,qy,qz,qw",
        "x[mm],y [mm],z (mm),q_x,q_y,q_z,q_w",
        "tx ty tz qx qy qz qw",
        "# x y z qx qy qz qw",
        "# unit: mm\n# tx ty tz qx qy qz qw",
        "sep=,\nx,y,z,qx,qy,qz,qw",
        "X\tY\tZ\tQX\tQY\tQZ\tQW",
        ",".join([f"pose.position.{axis}" for axis in "xyz"])
        + "".join(f",pose.orientation.{part}" for part in "xyzw"),
    ],
)
def test_names_of_other_programs(tmp_path, header):
    row = "1.5,2.5,3.5,0.6,0,0,0.8"
    if "\t" in header:
        row = row.replace(",", "\t").replace(".", ",")
    elif "," not in header:
        row = row.replace(",", " ")
    read = read_poses(written(tmp_path, f"{header}\n{row}\n")).matrices
    assert_allclose(read, [pose((0.6, 0.0, 0.0, 0.8), (1.5, 2.5, 3.5))], atol=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "x [m],y [m],z [m],qx,qy,qz,qw\n1,2,3,0,0,0,1\n",
        "# unit: m\nx,y,z,qx,qy,qz,qw\n1,2,3,0,0,0,1\n",
        "x,y,z,qx,qy,qz,qw,length_unit\n1,2,3,0,0,0,1,m\n",
        f"# unit: m\n{IDENTITY}\n",
    ],
)
def test_a_unit_that_a_table_states_must_be_the_one_it_is_read_in(tmp_path, text):
    path = written(tmp_path, text)
    with pytest.raises(InputError, match="states length_unit 'm', but is read with 'mm'"):
        read_poses(path)
    assert len(read_poses(path, length_unit="m").matrices) == 1


def test_matrices_may_have_brackets(tmp_path):
    for text in (str(LEVEL).replace("\n ", "\n"), str(LEVEL.tolist()).replace("], ", "],\n")):
        assert_array_equal(read_poses(written(tmp_path, text, "pose.txt")).matrices, [LEVEL])

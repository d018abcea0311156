"""Poses of robots: each maker's angles, the flange's camera, the robot's base."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from iriftrace.camera.pose import look_at
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.io.poses import read_poses
from iriftrace.sweep.options import SweepPoses

DATA = Path(__file__).parents[1] / "data" / "poses"

FIRST, SECOND, THIRD = 31.0, -47.5, 112.25


def elementary(axis, degrees):
    """Rotation about a coordinate axis, from the sine and cosine."""
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return {
        "x": np.array(((1, 0, 0), (0, c, -s), (0, s, c))),
        "y": np.array(((c, 0, s), (0, 1, 0), (-s, 0, c))),
        "z": np.array(((c, -s, 0), (s, c, 0), (0, 0, 1))),
    }[axis]


def product(*turns):
    return np.linalg.multi_dot([elementary(axis, degrees) for axis, degrees in turns])


# The makers' own products, with their first, second and third angle.
CARDAN = product(("z", THIRD), ("y", SECOND), ("x", FIRST))
PRODUCTS = {
    "fanuc": ("w,p,r", CARDAN),
    "yaskawa": ("rx,ry,rz", CARDAN),
    "mitsubishi": ("a,b,c", CARDAN),
    "kuka": ("a,b,c", product(("z", FIRST), ("y", SECOND), ("x", THIRD))),
    "staubli": ("rx,ry,rz", product(("x", FIRST), ("y", SECOND), ("z", THIRD))),
    "kawasaki": ("o,a,t", product(("z", FIRST), ("y", SECOND), ("z", THIRD))),
}


def written(folder, text, name="poses.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("robot", PRODUCTS)
def test_angles_are_those_of_the_maker(tmp_path, robot):
    columns, rotation = PRODUCTS[robot]
    path = written(tmp_path, f"x,y,z,{columns}\n1.5,-2,3,{FIRST},{SECOND},{THIRD}\n")
    matrix = read_poses(path, robot=robot).matrices[0]
    assert_allclose(matrix[:3, :3], rotation, atol=1e-15)
    assert_array_equal(matrix[:3, 3], (1.5, -2, 3))
    radians = ",".join(f"{math.radians(angle):.17g}" for angle in (FIRST, SECOND, THIRD))
    names = ",".join(f"{name} [rad]" for name in columns.split(","))
    path = written(tmp_path, f"X [m],Y [m],Z [m],{names}\n0.0015,-.002,.003,{radians}\n")
    in_radians = read_poses(path, robot=robot, length_unit="m").matrices[0]
    assert_allclose(in_radians, matrix, atol=1e-15)


def test_angles_that_are_rather_radians_are_warned_of(tmp_path):
    angles = "0,0,9,0.5,-1.2,3.1\n"
    with pytest.warns(IriftraceWarning, match=r"a, b, c are below 3\.15, as of radians"):
        read_poses(written(tmp_path, f"x,y,z,a,b,c\n{angles}"), robot="kuka")
    for unit in ("deg", "rad"):
        names = ",".join(f"{name} [{unit}]" for name in "abc")
        read_poses(written(tmp_path, f"x,y,z,{names}\n{angles}"), robot="kuka")


def test_a_tool_that_points_down():
    """KUKA's pose of a tool that looks at the table (A 90, B 0, C 180), as Excel saves it."""
    down, tilted = read_poses(DATA / "kuka.csv", robot="kuka").matrices
    assert_allclose(down[:3, :3].T, ((0, 1, 0), (1, 0, 0), (0, 0, -1)), atol=1e-15)
    assert_array_equal(down[:3, 3], (680, 0, 475))
    assert_allclose(tilted[:3, :3], PRODUCTS["kuka"][1], atol=1e-15)
    assert_array_equal(tilted[:3, 3], (680, -120.5, 475))


def test_a_rotation_vector_turns_about_its_axis_by_its_length(tmp_path):
    down, third = read_poses(DATA / "universal.csv", robot="universal", length_unit="m").matrices
    assert_allclose(down[:3], ((0, 1, 0, 680), (1, 0, 0, 0), (0, 0, -1, 475)), atol=1e-9)
    # A third of a turn about the room's diagonal moves x to y, y to z and z to x.
    assert_allclose(third[:3, :3].T, ((0, 1, 0), (0, 0, 1), (1, 0, 0)), atol=1e-9)
    path = written(tmp_path, "x,y,z,rx [deg],ry [deg],rz [deg]\n0,0,0,0,0,90\n")
    axes = read_poses(path, robot="universal").matrices[0, :3, :3]
    assert_allclose(axes.T, ((0, 1, 0), (-1, 0, 0), (0, 0, 1)), atol=1e-15)


def test_quaternions_of_abb_have_the_scalar_first(tmp_path):
    path = written(tmp_path, "x,y,z,q1,q2,q3,q4\n1,2,3,0.8,0.6,0,0\n")
    named = written(tmp_path, "x,y,z,qw,qx,qy,qz\n1,2,3,0.8,0.6,0,0\n", "named.csv")
    expected = read_poses(named).matrices
    assert_allclose(read_poses(path, robot="abb").matrices, expected, atol=1e-15)


@pytest.mark.parametrize(
    ("text", "robot", "columns"),
    [
        # Whose angles they are is never told by the columns, nor by their number.
        ("x,y,z,a,b,c\n0,0,0,1,2,3", None, "x,y,z,a,b,c"),
        ("x,y,z,w,p,r\n0,0,0,1,2,3", None, "x,y,z,w,p,r"),
        ("x,y,z,q1,q2,q3,q4\n0,0,0,0,0,0,1", None, "x,y,z,q1,q2,q3,q4"),
        ("0,0,0,90,0,180\n0,0,0,90,0,180", "kuka", "0,0,0,90,0,180"),
        ("x,y,z,w,p,r\n0,0,0,1,2,3", "kuka", "x,y,z,w,p,r"),
        ("x,y,a,b,c\n0,0,1,2,3", "kuka", "x,y,a,b,c"),
        # Of a log with the joints, and of two orientations, none is chosen.
        ("x,y,z,rx,ry,rz,q1\n0,0,0,1,2,3,4", "universal", "x,y,z,rx,ry,rz,q1"),
        ("x,y,z,qx,qy,qz,qw,rx,ry,rz\n0,0,0,0,0,0,1,9,0,0", "yaskawa", "x,y,z,qx,qy,qz,qw,rx"),
        ("x,y,z,q1 [rad],q2,q3,q4\n0,0,0,1,0,0,0", "abb", r"x,y,z,q1 \[rad\]"),
    ],
)
def test_other_columns_than_the_robots_are_refused_with_what_was_found(
    tmp_path, text, robot, columns
):
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=f"poses.csv has the columns '{columns}"):
        read_poses(path, robot=robot)


@pytest.mark.parametrize(
    ("text", "robot", "message"),
    [
        ("x,y,z,rx,ry,rz\n0,0,0,90,0,180", "universal", "length 201.2 rad, which is more than"),
        ("x,y,z,a [deg],b [rad],c [rad]\n0,0,0,1,2,3", "kuka", "states deg and rad"),
        ("x,y,z,a [gon],b [gon],c [gon]\n0,0,0,1,2,3", "kuka", "angles in gon"),
        ("x,y,z,q1,q2,q3,q4\n0,0,0,1,1,0,0", "abb", "line 2: the quaternion has length 1.41421"),
        ("x,y,z,a,b,c\n0,0,0,nan,0,180", "kuka", "Pose 1 of .* not finite"),
        ("x,y,z,rx,ry,rz\n0,0,0,inf,0,180", "universal", "not finite|more than a turn"),
    ],
)
def test_files_that_do_not_fit_the_robot(tmp_path, text, robot, message):
    path = written(tmp_path, text)
    with pytest.raises(InputError, match=message) as caught:
        read_poses(path, robot=robot)
    assert str(path) in str(caught.value)


def test_matrices_need_no_robot(tmp_path):
    np.save(tmp_path / "poses.npy", np.eye(4)[None])
    with pytest.raises(InputError, match="columns x, y, z, w, p, r"):
        read_poses(tmp_path / "poses.npy", robot="fanuc")


# The camera is 80 mm beside the flange and turned by a quarter about its axis.
FLANGE = {"robot": "fanuc", "length_unit": "m"}
HAND_EYE = np.array(((0, -1, 0, 80), (1, 0, 0, 0), (0, 0, 1, 25), (0, 0, 0, 1.0)))


def test_the_camera_of_a_flange_that_looks_down(tmp_path):
    path = written(tmp_path, "x,y,z,w,p,r\n0.6,0,0.5,180,0,0\n")
    camera = read_poses(path, **FLANGE, hand_eye=HAND_EYE).matrices[0]
    # The flange's x stays x, its y and z are turned round: 80 mm along x and 25 mm downwards.
    assert_allclose(camera[:3, 3], (680, 0, 475), atol=1e-12)
    assert_allclose(camera[:3, :3].T, ((0, -1, 0), (-1, 0, 0), (0, 0, -1)), atol=1e-15)
    # The base stands 680 mm before the part, at its height, and is turned by half.
    base_to_part = np.diag((-1.0, -1.0, 1.0, 1.0))
    base_to_part[0, 3] = 680.0
    placed = read_poses(path, **FLANGE, hand_eye=HAND_EYE, base_to_part=base_to_part)
    above = look_at((0, 0, 475), (0, 0, 0), (0, -1, 0))
    assert_allclose(placed.matrices[0, :3, 2:], above[:3, 2:], atol=1e-12)
    assert_allclose(placed.matrices[0], base_to_part @ camera, atol=1e-12)


def test_the_hand_eye_matrix_has_the_cameras_axes_of_the_convention(tmp_path):
    path = written(tmp_path, "x,y,z,w,p,r\n600,10,500,180,5,0\n")
    as_opencv = read_poses(path, robot="fanuc", hand_eye=HAND_EYE).matrices
    turned = HAND_EYE @ np.diag((1, -1, -1, 1))
    as_opengl = read_poses(path, "opengl", robot="fanuc", hand_eye=turned).matrices
    assert_allclose(as_opengl, as_opencv, atol=1e-12)


def test_matrices_of_frames_that_are_wrong(tmp_path):
    path = written(tmp_path, "x,y,z,w,p,r\n600,10,500,180,5,0\n")
    for name in ("hand_eye", "base_to_part"):
        with pytest.raises(InputError, match="is not a rigid motion"):
            read_poses(path, robot="fanuc", **{name: np.diag((2.0, 2.0, 2.0, 1.0))})
        with pytest.raises(InputError, match="is the matrix transposed"):
            read_poses(path, robot="fanuc", **{name: HAND_EYE.T})
    in_metres = HAND_EYE.copy()
    in_metres[:3, 3] /= 1000.0
    with pytest.warns(IriftraceWarning, match="camera 0.0838 mm from the flange, as if"):
        read_poses(path, robot="fanuc", hand_eye=in_metres)
    path = written(tmp_path, "x,y,z,target_x,target_y,target_z\n1,2,3,0,0,0\n")
    with pytest.raises(InputError, match="aims cameras at targets"):
        read_poses(path, hand_eye=HAND_EYE)


def test_options_of_a_sweep(tmp_path):
    path = written(tmp_path, "X,Y,Z,A,B,C\n0.6,0,0.5,0,0,180\n")
    motion = written(tmp_path, "# unit: m\n0 -1 0 0.08\n1 0 0 0\n0 0 1 0.025\n0 0 0 1\n", "he.txt")
    base = written(tmp_path, "1 0 0 -680\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", "base.txt")
    options = SweepPoses(
        poses=path, length_unit="m", robot="kuka", hand_eye=motion, base_to_part=base
    )
    part = SimpleNamespace(bounds=np.array(((-9.0,) * 3, (9.0,) * 3)), centre=np.zeros(3))
    camera = SimpleNamespace(
        projection="perspective",
        sensor_mm=(6.0, 5.0),
        focal_length_mm=10.0,
        focal_px=(1e3, 1e3),
        focus_mm=(50.0, 600.0),
    )
    (poses,) = options.pose_sets(SimpleNamespace(camera=camera, part=part)).values()
    assert_allclose(poses.origins, [(0, 0, 475)], atol=1e-12)
    for name, value in (("robot", "kuka"), ("hand_eye", motion), ("base_to_part", base)):
        with pytest.raises(InputError) as error:
            SweepPoses(**{name: value})
        assert (error.value.code, error.value.argument) == ("poses.no_file", name)

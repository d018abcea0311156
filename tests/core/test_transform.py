"""Transforms written as text: order, sense of rotation, files, and what is refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from iriftrace.core.errors import InputError
from iriftrace.core.mesh.transform import apply, parse_transform, rigid_motion

AXES = np.eye(3)


@pytest.mark.parametrize(
    ("text", "images"),
    [
        # A quarter turn about x carries y to z (right-handed), and so on round the axes.
        ("rotate x 90", [(1, 0, 0), (0, 0, 1), (0, -1, 0)]),
        ("rotate y 90", [(0, 0, -1), (0, 1, 0), (1, 0, 0)]),
        ("rotate z 90", [(0, 1, 0), (-1, 0, 0), (0, 0, 1)]),
        ("rotate z -180", [(-1, 0, 0), (0, -1, 0), (0, 0, 1)]),
        ("scale 0.001", [(0.001, 0, 0), (0, 0.001, 0), (0, 0, 0.001)]),
        ("scale 1 2 -3", [(1, 0, 0), (0, 2, 0), (0, 0, -3)]),
        ("translate 1 2 3", [(2, 2, 3), (1, 3, 3), (1, 2, 4)]),
    ],
)
def test_single_steps(text, images):
    # Equal, not close: a part turned by a quarter keeps its planes exactly.
    assert_array_equal(apply(parse_transform(text), AXES), images)


def test_the_left_step_comes_first():
    moved = apply(parse_transform("translate 1 0 0, rotate z 90,scale 2"), np.zeros((1, 3)))
    assert_array_equal(moved, [(0, 2, 0)])


def in_radians(angle: float) -> bool:
    """Whether it is some quarter turns in radians, which is refused."""
    turns = angle / (np.pi / 2)
    return bool(0 < abs(round(turns)) < 5 and abs(turns - round(turns)) < 1e-3)


@given(st.sampled_from("xyz"), st.floats(-720.0, 720.0).filter(lambda x: not in_radians(x)))
def test_rotations_are_those_of_scipy(axis, angle):
    expected = Rotation.from_euler(axis, angle, degrees=True).as_matrix()
    assert_allclose(parse_transform(f"rotate {axis} {angle!r}")[:3, :3], expected, atol=1e-12)


@pytest.mark.parametrize("steps", ["rotate x 30, translate 1 2 3", "rotate x 30, scale 1000"])
def test_numbers_and_files_hold_a_matrix_row_by_row(tmp_path, steps):
    """A matrix may change the unit, too."""
    matrix = parse_transform(steps)
    text = " ".join(map(repr, matrix.ravel().tolist()))
    assert_array_equal(parse_transform(text), matrix)
    assert_array_equal(parse_transform(text.replace(" ", ", ")), matrix)
    path = tmp_path / "pose.txt"
    for rows in (matrix, matrix[:3]):
        np.savetxt(path, rows, fmt="%.17g")
        assert_array_equal(parse_transform(str(path)), matrix)
    np.savetxt(path, matrix[:3].T, fmt="%.17g")
    with pytest.raises(InputError, match=r"is not a rotation|is singular"):
        parse_transform(str(path))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "step '' is not known"),
        ("turn x 90", "'turn x 90' is not known"),
        ("rotate w 90", "'rotate w 90' is not known"),
        ("rotate x", "'rotate x' is not known"),
        ("rotate x ninety", "'ninety'"),
        ("scale 1 2", "'scale 1 2' is not known"),
        ("scale 0", "singular"),
        ("translate 1 2 nan", "not finite"),
        ("1 2 3", "3 numbers"),
        ("1 0 0 0 0 1 0 0 0 0 1 0 5 6 7 1", "transposed"),
        ("no_such_file.txt", "no_such_file.txt does not exist"),
        ("rotate x 1.5708", "is 90 degrees in radians"),
        ("rotate z -3.14159", "is -180 degrees in radians"),
        # A shear, a mirror, and one column of a rotation twice as long.
        ("1 0.1 0 0 0 1 0 0 0 0 1 0 0 0 0 1", "mirrors, shears or scales"),
        ("1 0 0 0 0 1 0 0 0 0 -1 0 0 0 0 1", "mirrors, shears or scales"),
        ("0 -1 0 5 2 0 0 6 0 0 1 7 0 0 0 1", r"from 1 to 2\); correct it"),
    ],
)
def test_wrong_transforms_are_refused(text, message):
    with pytest.raises(InputError, match=message):
        parse_transform(text)


def test_files_that_hold_something_else_are_refused(tmp_path):
    path = tmp_path / "pose.txt"
    path.write_text("rotate x 90")
    with pytest.raises(InputError, match="expected 16 numbers"):
        parse_transform(str(path))


def test_a_rounded_motion_is_made_rigid_and_others_are_refused():
    """To four decimals, as alignments are printed; a scale of a thousandth is no rounding."""
    exact = parse_transform("rotate x 31, rotate z 77, translate 10 -20 30")
    motion = rigid_motion(exact.round(4), "motion.txt")
    assert_allclose(motion[:3, :3] @ motion[:3, :3].T, np.eye(3), atol=1e-15)
    assert_allclose(motion, exact, atol=1e-4)
    for text in ("scale 1.001", "scale 1 -1 1"):
        with pytest.raises(InputError, match="not a rigid motion"):
            rigid_motion(parse_transform(text), "motion.txt")


def test_files_with_brackets_comments_and_marks(tmp_path: Path) -> None:
    matrix = np.eye(4)
    matrix[:3, 3] = 1.0, 2.0, 3.0
    rows = [" ".join(f"{number:.1f}" for number in row) for row in matrix]
    for text in (
        json.dumps(matrix.tolist()),
        str(matrix),
        f"\ufeff# CloudCompare\n{matrix}",
        f"% MATLAB\nT = [ {' ; '.join(rows)} ];",
        "// with remarks\n" + "\n".join(f"{row}  # of a row" for row in rows),
        repr(matrix),
        "\n".join(rows).replace(".", ","),
        ";".join(rows).replace(".", ",").replace(" ", ";"),
    ):
        (tmp_path / "m.txt").write_text(text, encoding="utf-8")
        np.testing.assert_array_equal(parse_transform(str(tmp_path / "m.txt")), matrix)
    (tmp_path / "m.txt").write_text(f"# unit: m\n{matrix}")
    assert_array_equal(parse_transform(str(tmp_path / "m.txt"))[:3, 3], (1e3, 2e3, 3e3))
    (tmp_path / "m.txt").write_text("1,5 " * 17)
    with pytest.raises(InputError, match=r"34 numbers; .* with decimal points"):
        parse_transform(str(tmp_path / "m.txt"))

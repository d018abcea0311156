"""Orbits: where cameras stand, where they look, how they are rolled, and how they leave hot air."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial import ConvexHull, KDTree

from iriftrace.camera.camera import Camera
from iriftrace.camera.orbit import (
    Orbit,
    default_stand_off,
    fibonacci_poses,
    orbit_poses,
    parse_range,
    semi_axes,
)
from iriftrace.camera.pose import look_at
from iriftrace.camera.pose_set import aimed, offset_outward
from iriftrace.core.errors import InputError
from iriftrace.part.part import part_of_mesh
from validation.inputs.cameras import camera_at

CENTRE = np.array((3.0, -7.0, 11.0))
AXES = np.array((225.0, 190.0, 160.0))
TARGET = np.array((40.0, 5.0, -20.0))

coordinate = st.floats(-300.0, 300.0)
azimuths = st.floats(-720.0, 720.0)
slants = st.floats(-89.9, 89.9)
kinds = st.sampled_from(["parameter", "geocentric"])


def orbit(angles="parameter", centre=CENTRE):
    return Orbit(centre, AXES, angles)


def box(*size):
    """A part with the given dimensions, centred at the origin."""
    corners = np.array(np.meshgrid((-0.5, 0.5), (-0.5, 0.5), (-0.5, 0.5))).reshape(3, -1).T
    hull = ConvexHull(corners * size)
    outward = hull.equations[:, :3]
    a, b, c = (hull.points[hull.simplices[:, k]] for k in range(3))
    turned = np.einsum("ij,ij->i", np.cross(b - a, c - a), outward) < 0
    faces = np.where(turned[:, None], hull.simplices[:, ::-1], hull.simplices)
    return part_of_mesh(hull.points, faces, name="box")


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("0:90:10", [0, 10, 20, 30, 40, 50, 60, 70, 80, 90]),
        ("-90:90:19", np.arange(-90, 91, 10)),
        ("90:0:3", [90, 45, 0]),
        (" 30 ", [30]),
        ("-1e1", [-10]),
        ("5:5:1", [5]),
    ],
)
def test_a_range_includes_both_ends(text, values):
    assert_array_equal(parse_range(text), values)


@given(st.floats(0.1, 180.0), st.integers(2, 200))
def test_a_symmetric_range_is_symmetric_to_the_last_bit(end, count):
    values = parse_range(f"{-end!r}:{end!r}:{count}")
    assert_array_equal(values, -values[::-1])
    assert values[-1] == end
    assert_allclose(np.diff(values), 2 * end / (count - 1), rtol=1e-9)


@pytest.mark.parametrize(
    "text",
    ["", "a", "1:2", "0:90:10:1", "0:90:", "0:90:2.5", "nan", "0:inf:3", "0:90:1e1"],
)
def test_what_is_no_range(text):
    with pytest.raises(InputError, match="is not a range"):
        parse_range(text)


@pytest.mark.parametrize("text", ["0:90:0", "0:90:1", "0:90:-3", "5:5:2", "0:1:1000000000000"])
def test_a_count_that_does_not_fit_the_ends(text):
    with pytest.raises(InputError, match="count that does not fit"):
        parse_range(text)


@given(azimuths, slants)
def test_parameters_are_those_of_the_formula(azimuth, elevation):
    a, e = np.radians((azimuth, elevation))
    expected = AXES * (np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e))
    # The radians of two turns carry an error of 1e-15, which the semi-axis stretches.
    assert_allclose(
        orbit(centre=np.zeros(3)).points([azimuth], [elevation])[0], expected, atol=1e-12
    )


@given(azimuths, slants)
def test_geocentric_angles_are_the_direction_from_the_centre(azimuth, elevation):
    place = orbit("geocentric", np.zeros(3)).points([azimuth], [elevation])[0]
    assert np.sum((place / AXES) ** 2) == pytest.approx(1.0, abs=1e-14)
    x, y, z = place
    assert np.degrees(np.arctan2(z, np.hypot(x, y))) == pytest.approx(elevation, abs=1e-10)
    turn = np.degrees(np.arctan2(y, x)) - azimuth
    assert turn == pytest.approx(360.0 * round(turn / 360.0), abs=1e-9)


def test_both_kinds_of_angles_agree_on_a_sphere_only():
    angles = ([30.0, 200.0], [50.0, -10.0])
    ball = [
        Orbit(CENTRE, (90.0, 90.0, 90.0), kind).points(*angles)
        for kind in ("parameter", "geocentric")
    ]
    assert_allclose(ball[0], ball[1], atol=1e-12)
    # At elevation 45 the parameter point of semi-axes (2, 2, 1) is seen at atan(1/2).
    flat = Orbit(np.zeros(3), (2.0, 2.0, 1.0)).points([0.0], [45.0])[0]
    assert flat[2] / flat[0] == pytest.approx(0.5)


def test_quarter_turns_are_exact():
    points = Orbit(np.zeros(3), AXES).points([0, 90, 180, 270, 360, 0, 0], [0, 0, 0, 0, 0, 90, -90])
    a, b, c = AXES
    assert_array_equal(
        points,
        [(a, 0, 0), (0, b, 0), (-a, 0, 0), (0, -b, 0), (a, 0, 0), (0, 0, c), (0, 0, -c)],
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((CENTRE, (1.0, 0.0, 1.0)), "semi-axes"),
        ((CENTRE, (1.0, -2.0, 1.0)), "semi-axes"),
        ((CENTRE, (1.0, np.inf, 1.0)), "semi-axes"),
        ((CENTRE, (1.0, 1.0)), "semi-axes"),
        (((0.0, np.nan, 0.0), AXES), "centre"),
        ((CENTRE, AXES, "geodetic"), "Unknown angles"),
    ],
)
def test_what_is_no_orbit(arguments, message):
    with pytest.raises(InputError, match=message):
        Orbit(*arguments)


def distance_from_axis(poses, target):
    """(n,) distance of a point from every optical axis, mm, and how far it lies ahead."""
    offset = target - poses.origins
    ahead = np.einsum("ij,ij->i", offset, poses.forward)
    return np.linalg.norm(offset - ahead[:, None] * poses.forward, axis=1), ahead


@given(azimuths, slants, kinds, st.tuples(coordinate, coordinate, coordinate))
def test_the_optical_axis_meets_the_target(azimuth, elevation, kind, target):
    poses = orbit_poses(orbit(kind), azimuth, elevation, target)
    miss, ahead = distance_from_axis(poses, np.array(target))
    assert miss[0] <= 1e-12 * max(ahead[0], 1.0)
    assert ahead[0] > 0


def test_without_a_target_the_cameras_look_at_the_centre():
    poses = orbit_poses(orbit(), parse_range("0:350:36"), parse_range("-90:90:19"))
    miss, ahead = distance_from_axis(poses, CENTRE)
    assert miss.max() < 1e-12
    assert_allclose(ahead, np.linalg.norm(poses.origins - CENTRE, axis=1), rtol=1e-15)


@given(azimuths, slants, st.booleans())
def test_poses_are_rigid_without_roll_and_have_up_up(azimuth, elevation, off_centre):
    target = TARGET if off_centre else CENTRE
    matrix = orbit_poses(orbit(), azimuth, elevation, target).matrices[0]
    axes = matrix[:3, :3]
    assert_allclose(axes.T @ axes, np.eye(3), atol=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert axes[2, 0] == 0.0  # the x-axis lies in the world's x-y plane, exactly
    # Rows count downwards, so a point 1 mm above the target appears in a smaller row.
    camera = Camera(
        focal_length_mm=10.0, sensor_mm=(6.7, 5.6), resolution=(2448, 2048), matrix=matrix
    )
    (x0, y0), (x1, y1) = camera.project([target, np.add(target, (0.0, 0.0, 1.0))])
    assert (x0, y0) == pytest.approx((1223.5, 1023.5), abs=1e-8)
    assert y1 < y0
    assert x1 == pytest.approx(x0, abs=1e-8)
    # look_at is written independently; both agree where the view is not vertical.
    assert_allclose(matrix, look_at(matrix[:3, 3], target), atol=1e-12)


def test_the_grid_goes_elevation_by_elevation_with_one_pose_at_each_pole():
    poses = orbit_poses(orbit(), [10.0, 20.0, 30.0], [-90.0, 0.0, 45.0, 90.0])
    assert len(poses) == 1 + 3 + 3 + 1
    assert_array_equal(poses.elevation_deg, [-90, 0, 0, 0, 45, 45, 45, 90])
    assert_array_equal(poses.azimuth_deg, [0, 10, 20, 30, 10, 20, 30, 0])
    assert_array_equal(poses.origins, orbit().points(poses.azimuth_deg, poses.elevation_deg))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_pole_is_the_limit_of_azimuth_0(sign):
    tilt = 1e-5
    pole = orbit_poses(orbit(), [77.0], [sign * 90.0]).matrices[0]
    near = orbit_poses(orbit(), [0.0], [sign * (90.0 - tilt)]).matrices[0]
    # The tilt of 1.7e-7 rad turns the axes by about as much and moves the point by 4e-5 mm.
    assert_allclose(pole[:3, :3], near[:3, :3], atol=1e-6)
    assert_allclose(pole[:3, 3], near[:3, 3], atol=1e-4)
    assert_array_equal(pole[:3, 0], (0, 1, 0))
    assert_array_equal(pole[:3, 1], (sign, 0, 0))
    assert_array_equal(pole[:3, 2], (0, 0, -sign))
    assert_array_equal(pole[:3, 3], np.add(CENTRE, (0, 0, sign * AXES[2])))


def test_the_target_decides_the_roll_at_the_pole_and_off_it():
    # Looking towards +x from above, the picture's right is -y.
    pose = orbit_poses(orbit(), [0.0], [90.0], np.add(CENTRE, (50.0, 0.0, 0.0))).matrices[0]
    assert_allclose(pose[:3, 0], (0, -1, 0), atol=1e-15)
    # A vertical view off the pole takes the same roll as at it.
    point = orbit().points([40.0], [60.0])[0]
    pose = orbit_poses(orbit(), [40.0], [60.0], point - (0.0, 0.0, 30.0)).matrices[0]
    assert_array_equal(pose[:3, :3], [(0, 1, 0), (1, 0, 0), (0, 0, -1)])


MIRRORS = {
    # World axis that is mirrored, and the angles of the mirrored camera.
    0: lambda azimuth, elevation: (180.0 - azimuth, elevation),
    1: lambda azimuth, elevation: (-azimuth, elevation),
    2: lambda azimuth, elevation: (azimuth, -elevation),
}


@pytest.mark.parametrize("axis", MIRRORS)
@pytest.mark.parametrize("kind", ["parameter", "geocentric"])
@given(azimuth=st.integers(-3600, 3600), elevation=st.integers(-899, 899))
def test_mirrored_angles_give_mirrored_poses_to_the_last_bit(axis, kind, azimuth, elevation):
    # Eighths of a degree, of which 180 minus the angle is exact too.
    angles = azimuth / 8, elevation / 16
    centred = orbit(kind, np.zeros(3))
    pose = orbit_poses(centred, *angles).matrices[0]
    mirrored = orbit_poses(centred, *MIRRORS[axis](*angles)).matrices[0]
    flip = np.eye(4)
    flip[axis, axis] = -1.0
    # A camera cannot be mirrored: its picture is, left to right, or top to bottom below the part.
    picture = np.diag((1.0, -1.0, 1.0, 1.0) if axis == 2 else (-1.0, 1.0, 1.0, 1.0))
    assert_array_equal(mirrored, flip @ pose @ picture)


@given(azimuths, slants)
def test_opposite_angles_give_opposite_points_to_the_last_bit(azimuth, elevation):
    centred = orbit(centre=np.zeros(3))
    x, y, z = centred.points([azimuth], [elevation])[0]
    assert_array_equal(centred.points([-azimuth], [-elevation]), [(x, -y, -z)])


@pytest.mark.parametrize(
    ("azimuth", "elevation", "message"),
    [
        (0.0, 90.5, "Elevation 90.5 degrees lies beyond the pole"),
        (0.0, [0.0, -120.0], "Elevation -120 degrees"),
        (np.nan, 0.0, "not finite"),
        (0.0, np.inf, "not finite"),
        # Each range alone is allowed; all combinations would fill the memory.
        (
            parse_range("0:90:99999"),
            parse_range("-90:90:99999"),
            "99999 azimuths at 99999 elevations",
        ),
    ],
)
def test_angles_that_are_refused(azimuth, elevation, message):
    with pytest.raises(InputError, match=message):
        orbit_poses(orbit(), azimuth, elevation)


def test_a_target_on_the_orbit_is_refused():
    with pytest.raises(InputError, match="stands on its own target"):
        orbit_poses(orbit(), [0.0, 90.0], 0.0, np.add(CENTRE, (0.0, AXES[1], 0.0)))
    with pytest.raises(InputError, match="not finite"):
        aimed(CENTRE, (0.0, np.nan, 0.0))


def test_the_end_of_a_full_circle_is_its_start_and_counts_once():
    poses = orbit_poses(orbit(), parse_range("-180:180:5"), 0.0)
    assert_array_equal(poses.azimuth_deg, [-180, -90, 0, 90])


@pytest.mark.parametrize("count", [1, 2, 100, 1001])
def test_fibonacci_poses_lie_on_the_orbit_and_look_at_the_target(count):
    poses = fibonacci_poses(orbit(), count, TARGET)
    assert len(poses) == count
    assert_allclose(np.sum(((poses.origins - CENTRE) / AXES) ** 2, axis=1), 1.0, atol=1e-13)
    assert distance_from_axis(poses, TARGET)[0].max() < 1e-12
    assert_array_equal(poses.origins, orbit().points(poses.azimuth_deg, poses.elevation_deg))
    assert np.all((poses.azimuth_deg >= 0) & (poses.azimuth_deg < 360))


@pytest.mark.parametrize("kind", ["parameter", "geocentric"])
def test_fibonacci_directions_are_even(kind):
    count = 2000
    poses = fibonacci_poses(Orbit(CENTRE, AXES, kind), count)
    unit = poses.origins - CENTRE
    if kind == "parameter":
        unit = unit / AXES
    unit = unit / np.linalg.norm(unit, axis=1, keepdims=True)
    # No point set has a smallest distance above sqrt(8 pi / sqrt(3) / n) = 3.81 / sqrt(n) (Fejes
    # Toth); this lattice has 3.09 / sqrt(n). Random points would have about 3.5 / n.
    nearest = KDTree(unit).query(unit, k=2)[0][:, 1] * np.sqrt(count)
    assert 3.0 < nearest.min() <= nearest.max() < 3.81
    # Moments of the even distribution: mean 0, second moment 1/3 in every direction.
    assert_allclose(unit.mean(axis=0), 0.0, atol=1e-3)
    assert_allclose(unit.T @ unit / count, np.eye(3) / 3, atol=1e-3)
    for wrong in (0, -1, 10**9):
        with pytest.raises(InputError, match="make no sweep"):
            fibonacci_poses(orbit(), wrong)


def test_semi_axes_are_half_extents_and_stand_off():
    part = box(170.0, 27.0, 30.0)
    assert_allclose(semi_axes(part, 140.0), (225.0, 153.5, 155.0), rtol=1e-12)
    for stand_off in (0.0, -5.0, np.nan):
        with pytest.raises(InputError, match="stand-off"):
            semi_axes(part, stand_off)


def test_by_default_all_of_a_part_is_in_focus_from_everywhere_or_cameras_stand_in_its_middle():
    part = box(60.0, 27.0, 30.0)
    camera = camera_at((0.0, -80.0, 0.0), focus_mm=(50.0, 250.0))
    stand_off = default_stand_off(part, camera)
    poses = fibonacci_poses(Orbit(part.centre, semi_axes(part, stand_off)), 200)
    distances = np.linalg.norm(poses.origins[:, None] - part.vertices, axis=-1)
    assert 50.0 < distances.min() < 240.0 < distances.max() < 250.0
    assert default_stand_off(box(170.0, 27.0, 27.0), camera) == 150.0


def test_without_a_focus_cameras_stand_as_far_as_that_of_the_scene():
    """80 mm from the middle of a box that is 27 mm deep, up to a millimetre."""
    assert default_stand_off(box(60.0, 27.0, 30.0), camera_at((0.0, -80.0, 0.0))) == 67.0


def ball(radius):
    return lambda points: np.linalg.norm(points - CENTRE, axis=1) < radius


def test_poses_in_hot_air_go_back_along_their_axes_until_they_are_out():
    poses = orbit_poses(orbit(), parse_range("0:315:8"), [-90.0, -40.0, 0.0, 40.0, 90.0])
    before = np.linalg.norm(poses.origins - CENTRE, axis=1)
    out, moved = offset_outward(poses, ball(200.0))
    after = np.linalg.norm(out.origins - CENTRE, axis=1)
    assert_array_equal(moved, before < 200.0)
    assert 0 < moved.sum() < len(poses)
    assert_array_equal(out.matrices[~moved], poses.matrices[~moved])
    # All look at the centre, so going back is going out: beyond the ball by less than one step.
    assert np.all((after[moved] >= 200.0 - 1e-12) & (after[moved] < 205.0 + 1e-9))
    steps = (after - before)[moved] / 5.0
    assert_allclose(steps, np.round(steps), atol=1e-9)
    assert_array_equal(out.matrices[:, :3, :3], poses.matrices[:, :3, :3])
    assert_array_equal(out.elevation_deg, poses.elevation_deg)
    assert distance_from_axis(out, CENTRE)[0].max() < 1e-11


def test_cold_poses_stay_and_hot_ones_may_have_no_way_out():
    poses = fibonacci_poses(orbit(), 20)
    out, moved = offset_outward(poses, ball(10.0))
    assert not moved.any()
    assert_array_equal(out.matrices, poses.matrices)
    with pytest.raises(InputError, match="still in the hot air 10 m further back"):
        offset_outward(fibonacci_poses(orbit(), 3), ball(1e6))

"""Bevel gears against the geometry of cones and involutes."""

from itertools import pairwise

import numpy as np
import pytest

from iriftrace.core.errors import InputError
from scenes.generators.bevel_gear import REGIONS, TOOTH, Involute, bevel_gear


def outline_of(teeth: int, module: float, cone_deg: float) -> Involute:
    cosine = np.cos(np.radians(cone_deg))
    radius = 0.5 * teeth * module
    return Involute(
        teeth, radius, radius - 1.25 * module * cosine, radius + module * cosine, np.radians(20.0)
    )


def frustum(one: tuple[float, float], other: tuple[float, float]) -> float:
    """Volume under a straight piece of a section, (radius, height) to (radius, height)."""
    (r, z), (s, w) = one, other
    return np.pi / 3 * (w - z) * (r * r + r * s + s * s)


def gear_volume(
    teeth: int, module: float, cone_deg: float, bore: float, hub: float, hub_length: float
) -> float:
    """Volume of a gear whose curves are finely divided, mm^3.

    Between the two back cones every point is apex + s (Q - apex), Q on the outer one, and the
    volume element is s^2 r dr dtheta ds times R (t + 1/t), R the pitch radius and t the cone's
    slope; so it is the area of the teeth's outline times R (t + 1/t) (1 - s^3) / 3. The rest is
    turned, but for the end faces of the teeth: straight lines from the outline at the small end to
    two thirds of the way from bore to root, and from that at the large end to the rim.
    """
    outline = outline_of(teeth, module, cone_deg)
    pitch, root, slope = outline.pitch_radius, outline.root_radius, np.tan(np.radians(cone_deg))
    radius, angle = outline.points.T
    x, y = radius * np.cos(angle), radius * np.sin(angle)
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    small, height = 2 / 3, pitch / slope
    between = area * pitch * (slope + 1 / slope) * (1 - small**3) / 3

    def on_cone(share: float, size: np.ndarray | float) -> np.ndarray:
        """Radius and height on a back cone of points of the outer one."""
        low = height + share * ((size - pitch) * slope - height)
        return np.stack((share * size, low + 0.0 * size), axis=-1)

    def inside(share: float) -> float:
        """Volume between a back cone up to its root circle and the plane of that."""
        return frustum(tuple(on_cone(share, 0.0)), tuple(on_cone(share, root)))

    def end_faces(share: float, inner: np.ndarray) -> float:
        """Volume between a back cone beyond its root circle and lines to an inner circle."""
        one, two = on_cone(share, root) - inner, on_cone(share, radius) - inner
        section = 0.5 * (one[0] * two[:, 1] - one[1] * two[:, 0])
        middle = inner[0] + (one[0] + two[:, 0]) / 3
        moment = section * middle
        turns = np.diff(angle, append=angle[0] + 2 * np.pi)
        return float(np.sum(0.5 * (moment + np.roll(moment, -1)) * turns))

    small_root, front = on_cone(small, root)
    back_root = on_cone(1.0, root)[1]
    rim = np.array((root - 1.5, back_root - 1.5))
    section = [(hub / 2, -hub_length), (hub / 2, rim[1]), tuple(rim), (root, back_root)]
    below = sum(frustum(one, other) for one, other in pairwise(section))
    face = np.array((bore / 2 + (small_root - bore / 2) * 2 / 3, front))
    hole = np.pi * (bore / 2) ** 2 * (front + hub_length)
    turned = inside(small) - inside(1.0) + below - hole
    return between + turned + end_faces(small, face) - end_faces(1.0, rim)


@pytest.mark.parametrize(
    ("teeth", "module", "cone_deg", "bore", "hub"),
    [(20, 2.895, 45.0, 18.0, 40.0), (32, 2.0, 45.0, 20.0, 44.0), (24, 2.5, 60.0, 16.0, 36.0)],
)
def test_a_gear_is_closed_and_encloses_the_volume_of_its_cones(
    teeth: int, module: float, cone_deg: float, bore: float, hub: float
) -> None:
    part = bevel_gear(
        teeth,
        module,
        pitch_angle_deg=cone_deg,
        bore_diameter_mm=bore,
        hub_diameter_mm=hub,
        hub_length_mm=14.0,
    )
    assert part.closed
    exact = gear_volume(teeth, module, cone_deg, bore, hub, 14.0)
    # Chords cut off what the arcs have more: a share of 2 (pi / points)^2 / 3 of each circle.
    assert part.volume == pytest.approx(exact, rel=2e-4)


def test_flanks_are_involutes() -> None:
    """A line square to an involute touches its base circle."""
    outline = outline_of(20, 2.895, 45.0)
    radius = np.linspace(outline.pitch_radius, outline.tip_radius, 50)
    step = 1e-6
    points = [
        np.stack((r * np.cos(half), r * np.sin(half)))
        for r in (radius - step, radius, radius + step)
        for half in (outline.half_angle(r),)
    ]
    along = points[2] - points[0]
    along /= np.linalg.norm(along, axis=0)
    # How far the normal through a point passes the middle is the point's part along the flank.
    distance = np.abs(np.sum(points[1] * along, axis=0))
    assert distance[1:] == pytest.approx(np.full(49, outline.base_radius), rel=1e-6)


def test_teeth_and_gaps_are_equally_wide_at_the_pitch_circle() -> None:
    outline = outline_of(24, 2.0, 30.0)
    assert outline.half_angle(outline.pitch_radius) == pytest.approx(np.pi / 48, rel=1e-12)


def test_tooth_lines_meet_in_the_apex() -> None:
    """Normals of flanks, tips and roots are square to the line to the apex."""
    part = bevel_gear()
    tip = part.vertices[np.argmax(np.hypot(*part.vertices[:, :2].T))]
    pitch_plane = tip[2] - 2.895 * np.sin(np.radians(45.0))
    apex = np.array((0.0, 0.0, pitch_plane + 28.95))
    own = part.region_of_face == part.region_names.index("teeth")
    lines = part.face_centres[own] - apex
    lines /= np.linalg.norm(lines, axis=1)[:, None]
    assert np.abs(np.einsum("ij,ij->i", part.face_normals[own], lines)).max() < 1e-6


def test_the_defaults_are_the_part_that_was_simulated() -> None:
    """Volume, area and height of the surface around which the bundled field was solved."""
    part = bevel_gear()
    assert part.volume == pytest.approx(30057.5234, abs=1e-3)
    assert part.area == pytest.approx(10192.9304, abs=1e-3)
    assert part.bounds[1] == pytest.approx((30.997074, 30.997074, 11.507358), abs=1e-5)


def test_one_tooth_is_a_region_of_its_own() -> None:
    plain, named = bevel_gear(), bevel_gear(tooth=5)
    assert plain.region_names == REGIONS
    assert named.region_names == (TOOTH, *REGIONS)
    assert np.array_equal(plain.faces, named.faces)
    own = named.region_of_face == 0
    before = np.array(REGIONS)[plain.region_of_face[own]]
    assert set(before) == {"teeth", "front"}
    on_teeth = float(named.face_areas[own][before == "teeth"].sum())
    teeth = float(plain.region_areas[0])
    assert on_teeth == pytest.approx(teeth / 20, rel=1e-9)
    # Tooth 5 of 20 points a quarter turn from +x, and is symmetric.
    centre = np.average(named.face_centres[own], axis=0, weights=named.face_areas[own])
    # But for the diagonals of its squares.
    assert abs(centre[0]) < 1e-3 * centre[1]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"teeth": 5}, "give 8 to 400 teeth"),
        ({"bore_diameter_mm": 41.0}, "must be less than its hub diameter"),
        ({"bore_diameter_mm": 36.0}, "the bore would cut the teeth"),
        ({"hub_diameter_mm": 55.0}, "the hub stands on the rim's back"),
        ({"hub_length_mm": 4.0}, "the hub ends behind the rim"),
        ({"face_width_mm": 41.0}, "its teeth end before the apex"),
        ({"pitch_angle_deg": 85.0}, "give 10 to 80"),
        ({"tooth": 20}, "give 0 to 19"),
        ({"module_mm": float("nan")}, "makes no solid"),
    ],
)
def test_sizes_that_make_no_gear_are_refused(given: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        bevel_gear(**given)

"""Fitted features against points of surfaces that are known, and against what no motion changes.

Points of exact surfaces come back to rounding; of disturbed ones the sum of squares is stationary
(its gradient by finite differences vanishes), which is what a least-squares fit is.
"""

import warnings

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.mesh.query import Surface
from iriftrace.io.part_files import read_part
from iriftrace.measuring.features.choice import FeatureChoice, found_features, surface_kind
from iriftrace.measuring.features.feature import Feature
from iriftrace.measuring.features.fit import fit_feature
from iriftrace.measuring.features.fitted import fit_features
from iriftrace.measuring.features.outliers import inliers
from iriftrace.measuring.features.quantity import Quantity
from iriftrace.measuring.two_devices.correction import Correction
from iriftrace.measuring.two_devices.decided import decided
from iriftrace.measuring.uncertainty.air_groups import OTHER_AIR, AirGroups
from iriftrace.measuring.uncertainty.decision import Tolerance
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.standards import cylinder
from iriftrace.scenes import folder_of

AXIS = np.array((0.2, -0.5, 0.8)) / np.linalg.norm((0.2, -0.5, 0.8))
PLACE = np.array((120.0, -45.0, 33.0))
LATERAL = FeatureChoice("cylinder", "lateral")
TURN = Rotation.align_vectors([AXIS], [(0.0, 0.0, 1.0)])[0]


def placed(local: np.ndarray) -> np.ndarray:
    points: np.ndarray = TURN.apply(local) + PLACE
    return points


def grid(kind: str, share: float = 1.0) -> np.ndarray:
    """Points of a feature about z, of a part of its circumference."""
    angle, height = (
        values.ravel()
        for values in np.meshgrid(np.linspace(0, share * 6.0, 40), np.linspace(-8, 11, 12))
    )
    if kind == "plane":
        return np.column_stack((10 * np.cos(angle) * height, 5 * np.sin(angle) * height, 0 * angle))
    if kind == "line":
        return np.column_stack((0 * height, 0 * height, height))
    if kind == "circle":
        return 7.5 * np.column_stack((np.cos(angle), np.sin(angle), 0 * angle))
    if kind == "sphere":
        polar = height / 8.0
        return 7.5 * np.column_stack(
            (np.cos(polar) * np.cos(angle), np.cos(polar) * np.sin(angle), np.sin(polar))
        )
    radius = 7.5 + (height * np.tan(0.2) if kind == "cone" else 0.0)
    return np.column_stack((radius * np.cos(angle), radius * np.sin(angle), height))


KINDS = ("plane", "line", "circle", "sphere", "cylinder", "cone")


def check(feature: Feature, atol: float) -> None:
    off = feature.position - PLACE
    if feature.direction is not None:
        assert abs(abs(feature.direction @ AXIS) - 1) < atol
        along = off @ AXIS
        if feature.kind in ("plane",):
            off = along * AXIS
        elif feature.kind != "circle":
            off = off - along * AXIS
    else:
        along = 0.0
    assert np.linalg.norm(off) < atol
    if feature.kind == "cone":
        assert feature.half_angle == pytest.approx(0.2, abs=atol)
        assert feature.at(PLACE + 3 * AXIS).size_mm == pytest.approx(15 + 6 * np.tan(0.2), abs=atol)
        assert feature.size_mm == pytest.approx(15.0 + 2 * along * np.tan(0.2), abs=atol)
    elif feature.size_mm is not None:
        assert feature.size_mm == pytest.approx(15.0, abs=atol)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("share", [1.0, 0.3])
def test_exact_points_come_back(kind: str, share: float) -> None:
    """To 1e-9 mm, of 3 to 170 degrees of the circumference, 130 mm from the origin."""
    feature = fit_feature(placed(grid(kind, share)), kind)
    assert feature.kind == kind
    check(feature, 1e-9)
    assert feature.form_mm < 1e-9


@pytest.mark.parametrize("kind", KINDS)
def test_no_motion_makes_the_squares_smaller(kind: str) -> None:
    """Noisy points are moved a little every way: the fit's own residuals are the least."""
    noise = np.random.default_rng(2).normal(0, 0.01, grid(kind).shape)
    points = placed(grid(kind) + noise)
    feature = fit_feature(points, kind)
    best = float(feature.residuals @ feature.residuals)
    assert feature.form_mm == pytest.approx(np.ptp(feature.residuals))
    for step in np.vstack((np.eye(6), -np.eye(6))) * 1e-3:
        turned = Rotation.from_rotvec(step[:3] * 0.1).apply(points - feature.position)
        moved = turned + feature.position + step[3:]
        assert squares(moved, feature) >= best * (1 - 1e-9)


def squares(points: np.ndarray, like: Feature) -> float:
    """Sum of squared distances of points from a feature that stays where it is."""
    arm = points - like.position
    if like.kind == "sphere":
        off = np.linalg.norm(arm, axis=1) - like.size_mm / 2
        return float(off @ off)
    height = arm @ like.direction
    radius = np.linalg.norm(arm - np.outer(height, like.direction), axis=1)
    if like.kind == "plane":
        return float(height @ height)
    if like.kind == "line":
        return float(radius @ radius)
    if like.kind == "circle":
        return float(height @ height + (radius - like.size_mm / 2) @ (radius - like.size_mm / 2))
    if like.kind == "cylinder":
        return float((radius - like.size_mm / 2) @ (radius - like.size_mm / 2))
    opened = []
    for sign in (1, -1):
        off = (radius - like.size_mm / 2) * np.cos(like.half_angle)
        off -= sign * height * np.sin(like.half_angle)
        opened.append(float(off @ off))
    return min(opened)


@pytest.mark.parametrize(
    ("points", "kind", "said"),
    [
        (np.zeros((5, 3)), "torus", "no feature 'torus'"),
        (np.zeros((4, 3)), "cylinder", "at least 5 points"),
        (np.zeros((9, 3)), "sphere", "All points are the same"),
    ],
)
def test_what_determines_no_feature_is_refused(points: np.ndarray, kind: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        fit_feature(points, kind)


@pytest.mark.parametrize("kind", ["plane", "cylinder", "cone", "sphere"])
@pytest.mark.parametrize("share", [1.0, 0.3])
def test_surfaces_are_told_apart(kind: str, share: float) -> None:
    assert surface_kind(placed(grid(kind, share))) == kind


def test_a_free_form_is_no_such_surface() -> None:
    x, y = np.meshgrid(np.linspace(-5, 5, 20), np.linspace(-5, 5, 20))
    saddle = np.column_stack((x.ravel(), y.ravel(), 0.05 * (x * y).ravel()))
    assert surface_kind(placed(saddle)) is None


@pytest.mark.parametrize("part", [cylinder(), read_part(folder_of("cylinder") / "part.ply")])
def test_regions_of_a_cylinder_are_found_by_themselves(part: Part) -> None:
    """Each by what it is, and only those that were seen."""
    face = np.repeat(np.arange(len(part.faces)), 100)
    assert set(found_features(part, face)) == {
        LATERAL,
        FeatureChoice("plane", "head -x"),
        FeatureChoice("plane", "head +x"),
    }
    lateral = face[part.region_of_face[face] == part.region_names.index("lateral")]
    points = part.vertices[part.faces[lateral, 0]]
    (feature,) = fit_features({"cold": points}, lateral, part)
    assert (feature.kind, feature.region) == ("cylinder", "lateral")
    assert feature.size.by_cloud["cold"] == pytest.approx(27.0, abs=0.01)


def test_a_kind_alone_means_the_regions_that_are_one() -> None:
    """A kind that none is, is refused; one of which too little was measured, left out."""
    part = cylinder()
    face = np.repeat(np.arange(len(part.faces)), 100)
    points = part.vertices[part.faces[face, 0]]
    choices = [FeatureChoice("plane"), FeatureChoice("cylinder")]
    regions = [each.region for each in fit_features({"cold": points}, face, part, choices)]
    assert (sorted(regions[:2]), regions[2:]) == (["head +x", "head -x"], ["lateral"])
    with pytest.raises(InputError, match=r"No region of the part is a sphere; .*cylinder:lateral"):
        fit_features({"cold": points}, face, part, [FeatureChoice("sphere")])
    with pytest.raises(InputError, match="give such as cylinder:lateral"):
        fit_features({"cold": points}, face, part, [FeatureChoice.of("lateral")])
    with pytest.warns(IriftraceWarning, match="is a cylinder, not a sphere. Use"):
        fit_features({"cold": points}, face, part, [FeatureChoice("sphere", "lateral")])
    lateral = np.flatnonzero(part.region_of_face == part.region_names.index("lateral"))
    face = lateral[:: len(lateral) // 50][:50]
    points = part.vertices[part.faces[face, 0]]
    with pytest.warns(IriftraceWarning, match="cylinder is left out: No region .* 100 measured"):
        assert fit_features({"cold": points}, face, part, [FeatureChoice("cylinder")]) == ()
    with pytest.warns(IriftraceWarning, match=r"are not fitted: cylinder:lateral \(50\); look"):
        assert fit_features({"cold": points}, face, part) == ()


def test_diameters_of_a_cone_hold_at_one_height() -> None:
    """A cone that is measured 1 mm higher than it is has another diameter there."""
    points = grid("cone")
    clouds = {"measured": points + np.array((0.0, 0.0, 1.0)), "cold": points}
    face = np.zeros(len(points), dtype=np.int64)
    (found,) = fit_features(clouds, face, cylinder(), ["cone:"], gate=None)
    z = found.fits["cold"].position[2]
    assert found.place == f"(0.00, 0.00, {z:.2f}) mm"
    sizes = found.size.by_cloud
    assert sizes["cold"] == pytest.approx(15 + 2 * z * np.tan(0.2), abs=1e-6)
    assert sizes["measured"] == pytest.approx(15 + 2 * (z - 1) * np.tan(0.2), abs=1e-6)
    assert Quantity.of(found.as_dict()).by_cloud == sizes  # as the page of a report reads it


def test_a_turned_cone_has_the_same_diameters_as_measured_and_as_corrected() -> None:
    """They hold at the height of the cold or corrected one, wherever the measured one's axis is."""
    cold = grid("cone")
    cold = cold[cold[:, 0] > np.median(cold[:, 0])]  # one side, whose cone turns far
    turned = Rotation.from_rotvec((0.0, 0.2, 0.0)).as_matrix()
    hot = cold.mean(axis=0) + (cold - cold.mean(axis=0)) @ turned.T
    face = np.zeros(len(cold), dtype=np.int64)

    def sizes(clouds: dict[str, np.ndarray]) -> tuple[dict[str, float], str]:
        (found,) = fit_features(clouds, face, cylinder(), ["cone:"], gate=None)
        return {name: fit.size_mm for name, fit in found.fits.items()}, found.place

    measured, place = sizes({"cold": cold, "measured": hot})
    corrected, same = sizes({"measured": hot, "corrected": cold})
    assert same == place
    assert corrected == {"measured": measured["measured"], "corrected": measured["cold"]}


KNOWN = AirGroups(source="known", missing=())


def test_a_tolerance_of_a_cone_is_refused_from_python_too() -> None:
    """Also of a correction that has been saved; only features with one diameter are named."""
    points, part = grid("cone"), cylinder()
    found = Correction(
        *(points, np.zeros_like(points), np.zeros(len(points), dtype=np.int64)),
        *(np.zeros(len(points), dtype=np.int64), part.face_normals, "fringe"),
        provenance={},
    )
    features = found.features(part, ["cone:"], gate=None)
    saved = {"features": [one.as_dict() for one in features]}
    for name, code in (
        ("cone", "tolerance.of_cone"),
        ("plane:top", "tolerance.of_no_diameter"),
        ("cylinder:bore", "tolerance.of_no_feature"),
    ):
        tolerances = {name: Tolerance(15.0, -0.1, 0.1)}
        with pytest.raises(InputError) as error:
            found.features(part, ["cone:"], gate=None, tolerances=tolerances)
        assert error.value.code == code
        with pytest.raises(InputError) as error:
            decided(saved, tolerances)
        assert error.value.code == code


def test_a_correction_after_which_points_scatter_more_is_doubted() -> None:
    """A ripple of 50 um, which the air made or which only the correction has."""
    part = cylinder()
    points, face = part.surface.even_places(2000)
    error = 0.05 * np.cos(points[:, :1] / 10.0) * part.face_normals[face]
    status = np.zeros(len(points), dtype=np.int64)
    rest = status, face, part.face_normals, "fringe", {"field": {"source": "a solver"}}
    with warnings.catch_warnings():
        warnings.simplefilter("error", IriftraceWarning)
        Correction(points + error, error, *rest).features(part, ["cylinder"])
    said = r"3\d\.\d um \(as measured .* about cylinder:lateral"
    with pytest.warns(IriftraceWarning, match=said):
        (doubted,) = Correction(points, error, *rest, groups=KNOWN).features(
            part, ["cylinder"], tolerances={"cylinder:lateral": Tolerance(27.0, -9.0, 9.0)}
        )
    assert doubted.size.uncertainty is not None
    assert doubted.size.uncertainty.missing == (OTHER_AIR,)
    assert doubted.size.decision is not None
    assert doubted.size.decision.verdict == "not decided"


def test_what_points_do_not_determine_is_left_out() -> None:
    """The rest is still fitted; a kind or region that does not exist is refused."""
    part = cylinder()
    face = np.repeat(np.flatnonzero(part.region_of_face == part.region_names.index("head +x")), 100)
    points = part.vertices[part.faces[face, 0]]
    choices = [FeatureChoice("sphere", "head +x"), FeatureChoice("plane")]
    with pytest.warns(IriftraceWarning, match=r"sphere:head \+x is left out: .* lie on a plane"):
        (feature,) = fit_features({"cold": points}, face, part, choices)
    assert feature.kind == "plane"
    for choice in ("lateral:cylinder", "cylinder:side"):
        with pytest.raises(InputError, match=r"no feature 'lateral'|no region 'side'"):
            fit_features({"cold": points}, face, part, [FeatureChoice.of(choice)])


@pytest.mark.parametrize("kind", ["plane", "line", "circle", "cylinder"])
def test_a_direction_at_45_degrees_has_the_sense_of_the_first_fit(kind: str) -> None:
    """Its two largest components swap their rank between both clouds."""
    points = grid(kind, 0.3)
    along, _ = Rotation.align_vectors(((1.0, -1.0, 0.0),), (fit_feature(points, kind).direction,))
    first, second = (
        Rotation.from_euler("z", angle, degrees=True).apply(along.apply(points))
        for angle in (-1e-6, 1e-6)
    )
    fit = fit_feature(first, kind)
    assert fit.direction @ fit_feature(second, kind).direction < 0.0
    near = fit_feature(second, kind, near=fit)
    assert fit.direction == pytest.approx(near.direction, abs=1e-7)
    assert near.distances(second) == pytest.approx(near.residuals, abs=1e-9)


def test_a_published_circle() -> None:
    """Six points and their best circle by Gander, Golub and Strebel, BIT 34 (1994) 558."""
    places = np.array([(1, 7), (2, 6), (5, 8), (7, 7), (9, 5), (3, 7)], dtype=float)
    found = fit_feature(np.column_stack((places, np.zeros(6))), "circle")
    np.testing.assert_allclose(found.position, (4.7398, 2.9835, 0.0), atol=5e-5)
    assert found.size_mm == pytest.approx(2 * 4.7142, abs=1e-4)


@pytest.mark.parametrize("kind", ["circle", "sphere", "cylinder"])
def test_the_sizes_uncertainty_is_the_scatter_of_repeated_fits(kind: str) -> None:
    # A standard deviation of 40 values is itself uncertain by 11 %.
    rng = np.random.default_rng(5)
    points = grid(kind, share=0.25)
    fits = [fit_feature(points + rng.normal(0, 0.01, points.shape), kind) for _ in range(40)]
    stated = np.median([fit.u_size_mm for fit in fits if fit.u_size_mm is not None])
    scatter = np.std([fit.size_mm for fit in fits], ddof=1)
    assert stated == pytest.approx(scatter, rel=0.35)


def test_a_strip_that_is_nearly_flat_leaves_the_diameter_uncertain() -> None:
    part = read_part(folder_of("cylinder") / "part.ply")
    number = part.region_names.index("lateral")
    middle = part.vertices[part.faces].mean(axis=1)
    on_strip = (part.region_of_face == number) & (np.abs(middle[:, 1]) < 1.0) & (middle[:, 2] > 0)
    face = np.flatnonzero(on_strip)
    points = middle[face] + np.random.default_rng(2).normal(0, 0.02, (len(face), 3))
    with pytest.warns(IriftraceWarning, match="span too little of a cylinder"):
        fit_features({"measured": points}, face, part, [LATERAL])


@pytest.mark.parametrize("kind", ["plane", "circle", "sphere", "cylinder"])
@pytest.mark.parametrize("share", [0.03, 0.1])
def test_outliers_are_left_out(kind: str, share: float) -> None:
    """Noise of 10 um and outliers of 0.5 mm: within 3 u of the true size (U is 2 u).

    Of the outliers those below 3.5 standard deviations of the noise stay, 6 % of them.
    """
    rng = np.random.default_rng(3)
    exact = np.repeat(placed(grid(kind)), 4, axis=0)
    points = exact + rng.normal(0, 0.01, exact.shape)
    wrong = rng.random(len(points)) < share
    points[wrong] += rng.normal(0, 0.5, (wrong.sum(), 3))
    kept = inliers(points, kind, 3.5)
    assert 0.8 * wrong.mean() < np.mean(~kept) < 1.1 * wrong.mean()
    assert np.mean(kept[~wrong]) > 0.998
    found = fit_feature(points[kept], kind)
    if kind == "plane":
        assert np.sqrt(np.mean(found.residuals**2)) == pytest.approx(0.01, rel=0.1)
        assert abs(found.direction @ AXIS) > 1 - 1e-8
        return
    assert 2 * found.u_size_mm < 2e-3
    assert abs(found.size_mm - 15.0) < 3 * found.u_size_mm
    assert fit_feature(points, kind).u_size_mm > 4 * found.u_size_mm


def test_points_as_near_to_another_surface_are_left_out() -> None:
    """A plane of 20 mm with noise of 10 um, and a wall along one of its edges."""
    rng = np.random.default_rng(4)
    points = np.column_stack((rng.uniform(0, 20, (4000, 2)), rng.normal(0, 0.01, 4000)))
    points[:200, 0] = rng.uniform(0, 0.03, 200)
    wall = Surface([(0, -1, -1), (0, 21, -1), (0, 21, 1), (0, -1, 1)], [(0, 1, 2), (0, 2, 3)])
    kept = inliers(points, "plane", 3.5, [wall])
    assert not kept[:200].any()
    assert kept[200:].mean() > 0.99
    # Where that is most of them, nothing would be left to fit.
    assert inliers(points[:300], "plane", 3.5, [wall]).mean() > 0.99


@pytest.mark.parametrize("kind", KINDS)
def test_points_without_outliers_all_stay(kind: str) -> None:
    """Exact ones, of which rounding is no outlier, in single precision too; and with no gate."""
    points = placed(grid(kind, 0.3))
    assert inliers(points, kind, 3.5).all()
    assert inliers(points.astype(np.float32).astype(np.float64), kind, 3.5).all()
    assert inliers(points + np.random.default_rng(1).normal(0, 1, points.shape), kind, None).all()


@pytest.mark.parametrize("kind", KINDS)
def test_distances_are_the_residuals(kind: str) -> None:
    points = placed(grid(kind) + np.random.default_rng(2).normal(0, 0.01, grid(kind).shape))
    found = fit_feature(points, kind)
    np.testing.assert_allclose(found.distances(points), found.residuals, atol=1e-9)


def test_a_plane_seen_as_an_edge_is_left_out() -> None:
    mesh = trimesh.creation.box((50.0, 20.0, 20.0))
    part = part_of_mesh(mesh.vertices, mesh.faces, name="bar")
    points, face = part.surface.even_places(20_000)
    top = part.surface.normals[face, 2] > 0.9
    (plane,) = (part.region_names[n] for n in np.unique(part.region_of_face[face[top]]))

    def fitted(width: float) -> int:
        seen = top & (points[:, 1] < width - 10.0)
        return len(fit_features({"cold": points[seen]}, face[seen], part, [f"plane:{plane}"]))

    assert fitted(3.0) == 1
    with pytest.warns(IriftraceWarning, match=r"in a strip .* mm long and 0\.\d+ mm wide"):
        assert fitted(0.3) == 0


def test_fits_leave_the_outliers_of_the_corrected_cloud_out_of_all() -> None:
    """Not the points that the air moves, and says how many; all are fitted without a gate."""
    part = read_part(folder_of("cylinder") / "part.ply")
    face = np.flatnonzero(part.region_of_face == part.region_names.index("lateral"))
    cold = part.vertices[part.faces].mean(axis=1)[face]
    outliers, moved = np.zeros((2, *cold.shape))
    outliers[::50] = 0.5 * part.face_normals[face[::50]]
    moved[7::50] = 0.5 * part.face_normals[face[7::50]]
    clouds = {"measured": cold + outliers + moved, "corrected": cold + outliers}
    (feature,) = fit_features(clouds, face, part, [LATERAL])
    count = len(face[::50])
    assert (feature.points, feature.left_out) == (len(face) - count, count)
    (same,) = fit_features({"cold": cold, "measured": cold + moved}, face, part, [LATERAL])
    assert (same.points, same.left_out) == (len(face), 0)
    assert same.size.difference("measured", "cold") > 0.01
    (feature,) = fit_features(clouds, face, part, [LATERAL], gate=None)
    assert (feature.points, feature.left_out) == (len(face), 0)
    for gate in (0.5, float("nan")):
        with pytest.raises(InputError, match="at least 1, or none"):
            fit_features(clouds, face, part, [LATERAL], gate=gate)

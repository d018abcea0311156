"""Sizes of a hot part at the temperature of its drawing, against points on the drawing."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import IriftraceWarning
from iriftrace.core.mesh.transform import apply, parse_transform
from iriftrace.io.part_files import read_part, save_part
from iriftrace.io.reading import ReadPart
from iriftrace.measuring.features.drawing import drawing_cloud, u_of_growth
from iriftrace.measuring.features.fit import fit_feature
from iriftrace.measuring.features.fitted import FittedFeature, fit_features
from iriftrace.measuring.features.relations import Relation, relations
from iriftrace.measuring.two_devices.correction import Correction
from iriftrace.measuring.two_devices.decided import decided
from iriftrace.measuring.uncertainty.air_groups import AIR
from iriftrace.measuring.uncertainty.decision import Tolerance
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.part.growth import Growth
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.standards import between_poles, circle, cylinder
from iriftrace.part.tessellation import subdivide_part
from iriftrace.part.uneven_growth import grown_unevenly

ALPHA, COLD_K = 14e-6, 293.15


def scanned(hot: Part, deviation_mm: float = 0.0) -> tuple[FloatArray, IntArray, FloatArray]:
    """Points on a hot part, their faces, and the same points on its drawing.

    The surface deviates from the model by waves that grow like the part itself: by the mean of the
    strains along the three sides of a triangle.
    """
    assert hot.drawing is not None
    points, face = hot.surface.even_places(6000)
    corners, drawn = hot.vertices[hot.faces[face]], hot.drawing[hot.faces[face]]
    edges = (corners[:, 1:] - corners[:, :1]).swapaxes(1, 2)
    places = np.linalg.pinv(edges) @ (points - corners[:, 0])[:, :, None]
    cold = drawn[:, 0] + ((drawn[:, 1:] - drawn[:, :1]).swapaxes(1, 2) @ places)[:, :, 0]
    waves = deviation_mm * np.sin(0.3 * cold.sum(axis=1))[:, None]
    sides = (np.linalg.norm(mesh - np.roll(mesh, 1, axis=1), axis=2) for mesh in (corners, drawn))
    stretch = np.mean(np.divide(*sides), axis=1)[:, None]
    flat = evolve(hot, vertices=hot.drawing)
    return (
        points + stretch * waves * hot.surface.normals[face],
        face,
        cold + waves * flat.surface.normals[face],
    )


def corrected(part: Part, points: FloatArray, face: IntArray) -> Correction:
    """What `correct` gives for points in air without an effect."""
    return Correction(
        *(points, np.zeros_like(points), np.zeros(len(points), dtype=np.int64), face),
        *(part.face_normals, "fringe"),
        provenance={},
        growth=part.growth,
    )


def on_drawing(
    part: Part, points: FloatArray, face: IntArray, choices: Sequence[str] = ()
) -> tuple[tuple[FittedFeature, ...], tuple[Relation, ...]]:
    """Features and relations of a correction."""
    found = corrected(part, points, face)
    features = found.features(part, choices, gate=None)
    return features, found.relations(features)


def grown(part: Part, kelvins: Callable[[FloatArray], FloatArray]) -> Part:
    return grown_unevenly(part, ALPHA, COLD_K, kelvins)


def walls(part: Part, named: dict[str, float], other: float) -> Callable[[FloatArray], FloatArray]:
    """Temperatures of the walls nearest to points, by the names of regions."""
    kelvins = np.array([named.get(name, other) for name in part.region_names])

    def wall_k(points: FloatArray) -> FloatArray:
        return np.asarray(kelvins[part.region_of_face[part.surface.nearest(points)[1]]])

    return wall_k


def upright(drawn: Part) -> Part:
    """A cylinder along z in place of x."""
    return evolve(drawn, vertices=drawn.vertices[:, (1, 2, 0)])


@pytest.mark.parametrize("deviation_mm", [0.0, 0.2])
def test_a_cylinder_with_a_cool_head(deviation_mm: float) -> None:
    """One head at 500 degC, the rest at 1100: within 1 um of the same points on the drawing.

    Its other half is measured, of which one factor for the whole part is wrong by 5 um and more.
    """
    part = subdivide_part(upright(cylinder(27.0, 60.0)), 3.0)
    head = part.region_names[part.region_of_face[np.argmin(part.face_centres[:, 2])]]
    hot = grown(part, walls(part, {head: 773.15}, 1373.15))
    seen = (every := scanned(hot, deviation_mm))[2][:, 2] > 0.0
    points, face, cold = (each[seen] for each in every)
    (round_one,) = [each for each in on_drawing(hot, points, face)[0] if each.region == "lateral"]
    assert round_one.kind == "cylinder"
    lateral = hot.region_of_face[face] == hot.region_names.index("lateral")
    own = fit_feature(cold[lateral], "cylinder")
    found = round_one.fits["drawing"]
    assert found.size_mm == pytest.approx(own.size_mm, abs=1e-3)
    np.testing.assert_allclose(found.position, own.position, atol=1e-3)
    np.testing.assert_allclose(found.direction, own.direction, atol=1e-5)
    assert hot.growth is not None
    by_factor = fit_feature(points[lateral], "cylinder").size_mm / hot.growth.factor
    assert abs(by_factor - own.size_mm) > 5e-3
    assert round_one.size.answer == found.size_mm


def test_a_flange_with_a_cooler_hub() -> None:
    """Diameters, distances and angles of all its surfaces, each from the drawing's own points."""
    turn = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    rings = [
        circle(*each, turn) for each in ((60.0, 0.0), (60.0, 15.0), (30.0, 15.0), (30.0, 45.0))
    ]
    part = part_of_mesh(*between_poles(rings, 0.0, 45.0), name="flange")
    part = subdivide_part(part, 4.0)

    def kelvins(points: FloatArray) -> FloatArray:
        return np.where(np.hypot(*points[:, :2].T) < 32.0, 1073.15, 1323.15)

    hot = grown(part, kelvins)
    points, face, cold = scanned(hot)
    features, related = on_drawing(hot, points, face)
    own = {
        each.region: each.fits["cold"]
        for each in fit_features({"cold": cold}, face, part, gate=None)
    }
    assert {each.kind for each in features} == {"plane", "cylinder"}
    for each in features:
        found, true = each.fits["drawing"], own[each.region]
        np.testing.assert_allclose(found.position, true.position, atol=1e-3)
        assert found.size_mm == pytest.approx(true.size_mm, abs=1e-3)
    distances = [each.value for each in related if each.kind == "distance"]
    heights = sorted(each.by_cloud["drawing"] for each in distances)
    np.testing.assert_allclose(heights, (15.0, 30.0, 45.0), atol=1e-3)


def test_two_faces_in_one_plane_and_angles() -> None:
    """Their distance on the drawing is 0; square faces of a bent block are square within 1e-5."""
    import trimesh

    blocks = [trimesh.creation.box((10.0, 30.0, 20.0)) for _ in range(2)]
    for block, x in zip(blocks, (-10.0, 10.0), strict=True):
        block.apply_translation((x, 0.0, 0.0))
    mesh = trimesh.util.concatenate(blocks)
    part = subdivide_part(part_of_mesh(mesh.vertices, mesh.faces, name="blocks"), 3.0)
    bent = part.vertices.copy()
    bent[:, 2] += 2e-4 * bent[:, 0] ** 2 + 3e-3 * bent[:, 0]
    hot = evolve(
        part, vertices=1.012 * bent, drawing=part.vertices, growth=Growth(1e-5, COLD_K, 1493.15)
    )
    points, face, _ = scanned(hot)
    _, related = on_drawing(hot, points, face)
    drawn = [each.value.by_cloud["drawing"] for each in related]
    hot_values = [each.value.by_cloud["corrected"] for each in related]
    assert min(drawn) == pytest.approx(0.0, abs=1e-6)
    angles = [value for each, value in zip(related, drawn, strict=True) if each.kind == "angle"]
    assert len(angles) > 4
    np.testing.assert_allclose(np.radians(angles), np.pi / 2.0, atol=1e-5)
    assert np.abs(np.subtract(hot_values, drawn)).max() > 0.05


def test_an_evenly_hot_part_has_the_scatter_of_its_growth() -> None:
    """60 mm at 20 degC are 60.8652 mm at 1050 degC; u is the scatter of 20,000 draws."""
    cold, growth = cylinder(60.0, 120.0), Growth(ALPHA, COLD_K, 1323.15)
    part = evolve(cold, vertices=growth.factor * cold.vertices, growth=growth)
    face = np.repeat(np.flatnonzero(part.region_of_face == 0), 3)
    points = part.vertices[part.faces[face[::3]]].reshape(-1, 3)
    found = corrected(part, points, face)
    stated = evolve(found, inputs=Inputs(expansion=0.02, part_temperature_k=10))
    (size,) = [each.size for each in stated.features(part, ["cylinder:lateral"])]
    assert size.by_cloud["corrected"] == pytest.approx(60.8652, abs=1e-6)
    assert size.answer == pytest.approx(60.0, abs=1e-6)
    rng = np.random.default_rng(1)
    expansion = ALPHA * (1 + 0.02 * rng.normal(size=20000))
    sizes = 60.8652 / (1 + expansion * (1030.0 + 10.0 * rng.normal(size=20000)))
    assert size.uncertainty is not None
    assert size.uncertainty.parts["growth of the part"] == pytest.approx(sizes.std(), rel=0.02)
    assert size.uncertainty.missing == (AIR,)
    unknown = evolve(found, inputs=Inputs(expansion=0.02))
    (size,) = [each.size for each in unknown.features(part, ["cylinder:lateral"])]
    assert size.uncertainty is not None
    assert size.uncertainty.missing == (AIR, "growth of the part")


def test_a_hot_measurement_is_held_against_a_cold_tolerance_on_the_drawing() -> None:
    """60.8652 mm at 1050 degC are 60 mm on the drawing, and 0.1 mm of air 0.0986 mm."""
    cold, growth = cylinder(60.0, 120.0), Growth(ALPHA, COLD_K, 1323.15)
    part = evolve(cold, vertices=growth.factor * cold.vertices, growth=growth)
    face = np.repeat(np.flatnonzero(part.region_of_face == 0), 3)
    points = part.vertices[part.faces[face[::3]]].reshape(-1, 3)
    outwards = points * (0.0, 1.0, 1.0) / 60.8652
    true = corrected(part, points, face)
    for air_mm, within in ((0.0, True), (0.05, True), (0.1, False)):
        error = air_mm * outwards
        found = evolve(true, measured=points + error, error=error)
        stated = {"cylinder:lateral": Tolerance(60.0, -0.06, 0.06)}
        (one,) = found.features(part, ["cylinder:lateral"], tolerances=stated)
        assert one.size.uncorrected == pytest.approx(60.0 + air_mm / growth.factor, abs=1e-5)
        assert one.size.decision is not None
        assert one.size.decision.measured is within
        (row,) = decided({"features": [one.as_dict()]}, stated)["features"]
        assert row["decision"]["as_measured_within"] is within


def test_a_part_that_was_moved_has_its_place_on_the_drawing(tmp_path: Path) -> None:
    """It grows about the origin of its file, which lies 300 mm above that of the scene."""
    save_part(cylinder(60.0, 120.0), tmp_path / "cold.ply")
    move = np.eye(4)
    move[2, 3] = 300.0
    part = read_part(
        tmp_path / "cold.ply", ReadPart(transform=move, expansion=ALPHA, hot_temperature=1323.15)
    )
    points, face = part.surface.even_places(2000)
    (found,), _ = on_drawing(part, points, face, ["cylinder:lateral"])
    assert found.fits["drawing"].position[2] == pytest.approx(300.0, abs=1e-4)
    assert found.size.answer == pytest.approx(found.size.by_cloud["corrected"] / 1.01442)


def test_a_part_that_is_moved_after_it_has_grown_has_its_place_on_the_drawing(
    tmp_path: Path,
) -> None:
    """As where the scene, not its file, places the part: the same drawing by both."""
    save_part(cylinder(60.0, 120.0), tmp_path / "cold.ply")
    move = parse_transform("rotate x 30, translate 500 0 0")
    growth = {"expansion": ALPHA, "hot_temperature": "1050 degC"}
    parts = (
        read_part(tmp_path / "cold.ply", ReadPart(**growth)).transformed(move),
        read_part(tmp_path / "cold.ply", ReadPart(**growth, transform=move)),
    )
    points, face = parts[0].surface.even_places(200)
    moved, placed = (drawing_cloud(points, face, part)["drawing"] for part in parts)
    np.testing.assert_allclose(moved, placed, atol=1e-9)
    back = np.linalg.inv(move)
    np.testing.assert_allclose(apply(back, moved), apply(back, points) / 1.01442, atol=1e-4)


def test_the_growth_of_an_angle_is_uncertain_but_not_by_a_common_temperature() -> None:
    """An angle that growth changes by 0.1 degrees, by 2 % of that; a temperature changes none."""
    growth = Growth(1e-5, COLD_K, 1293.15)
    both = Inputs(expansion=0.02, part_temperature_k=10.0)
    assert u_of_growth(both, growth, 90.1, 90.0, angle=True) == pytest.approx(0.002 / 1.01)
    assert u_of_growth(both, growth, 101.0, 100.0, angle=False) == pytest.approx(
        np.hypot(0.02, 0.01) / 1.01
    )
    assert u_of_growth(Inputs(part_temperature_k=10.0), growth, 2.0, 1.0, angle=False) is None


def test_points_beyond_slivers_stay_finite() -> None:
    """A triangle of 1 mm by 1 nm, rounded to single precision, with a point 0.5 mm beside it."""
    vertices = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.5, 1e-6, 0.0), (0.5, -1.0, 0.0)])
    faces = np.array([(0, 1, 2), (1, 0, 3)])
    with pytest.warns(IriftraceWarning, match="not closed"):
        part = part_of_mesh(vertices, faces, name="sliver")
    drawn = np.asarray(vertices / 1.01, dtype=np.float32).astype(float)
    hot = evolve(part, drawing=drawn, growth=Growth(1e-5, COLD_K, 1293.15))
    point = np.array([(0.5, 0.4, 0.3)])
    (found,) = drawing_cloud(point, np.array([0]), hot).values()
    np.testing.assert_allclose(found, point / 1.01, atol=1e-5)


def test_a_cold_part_has_no_other_drawing() -> None:
    part = cylinder(60.0, 120.0)
    assert drawing_cloud(part.face_centres, np.arange(len(part.faces)), part) == {}


def test_relations_of_the_drawing_are_those_of_its_planes() -> None:
    """A block that grew by 1 % along x, 2 % along z, and whose sides lean by 0.1 degrees."""
    import trimesh

    mesh = trimesh.creation.box((20.0, 30.0, 40.0))
    shape = np.diag((1.01, 1.0, 1.02))
    shape[0, 2] = np.tan(np.radians(0.1))
    cold = part_of_mesh(mesh.vertices, mesh.faces, name="box")
    part: Part = evolve(
        cold,
        vertices=cold.vertices @ shape.T,
        drawing=cold.vertices,
        growth=Growth(1e-5, 293.15, 1500.0),
    )
    points, face = part.surface.even_places(2000)
    clouds = {"corrected": points, **drawing_cloud(points, face, part)}
    found = relations(fit_features(clouds, face, part, ["plane"], gate=None))
    drawn = {frozenset(each.regions): each.value.by_cloud["drawing"] for each in found}
    assert drawn[frozenset(("plane +z", "plane -z"))] == pytest.approx(40.0, abs=1e-9)
    angles = [
        value for each, value in zip(found, drawn.values(), strict=True) if each.kind == "angle"
    ]
    assert len(angles) == 12
    np.testing.assert_allclose(angles, 90.0, atol=1e-9)
    leaning = [each.value.by_cloud["corrected"] - 90.0 for each in found if each.kind == "angle"]
    assert np.abs(leaning).max() == pytest.approx(0.1, rel=0.05)

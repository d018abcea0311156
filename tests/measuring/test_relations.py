"""Distances and angles of planes, and values by region, of points in known places."""

import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from iriftrace.core.errors import IriftraceWarning
from iriftrace.measuring.features.choice import FeatureChoice
from iriftrace.measuring.features.fit import fit_feature
from iriftrace.measuring.features.fitted import fit_features
from iriftrace.measuring.features.quantity import Quantity, WorstMember
from iriftrace.measuring.features.relations import Relation, relations
from iriftrace.measuring.two_devices.correction import Correction
from iriftrace.measuring.two_devices.statistics import region_values
from iriftrace.measuring.uncertainty.air_groups import OTHER_AIR
from iriftrace.measuring.uncertainty.budget import Contribution, Uncertainty
from iriftrace.measuring.uncertainty.decision import Tolerance, decide
from iriftrace.part.part import Part, part_of_mesh

PLANES = (FeatureChoice("plane"),)


def box() -> Part:
    """20 x 30 x 40 mm."""
    import trimesh

    mesh = trimesh.creation.box((20.0, 30.0, 40.0))
    return part_of_mesh(mesh.vertices, mesh.faces, name="box")


def test_widths_and_squareness_of_a_box() -> None:
    """One side moved out by 10 um and another turned by 0.1 degrees, wherever the box stands."""
    part = box()
    points, face = part.surface.even_places(6000)
    names = np.array(part.region_names)[part.region_of_face[face]]
    hot = points.copy()
    hot[names == "plane +x"] += (0.01, 0.0, 0.0)
    turn = Rotation.from_euler("z", 0.1, degrees=True)
    hot[names == "plane +y"] = turn.apply(hot[names == "plane +y"])
    place = Rotation.from_rotvec((0.3, -0.2, 0.5))
    clouds = {"cold": place.apply(points), "measured": place.apply(hot)}
    found = relations(fit_features(clouds, face, part, PLANES, gate=None))
    values = {frozenset(each.regions): each.value.by_cloud for each in found}
    assert [each.kind for each in found].count("distance") == 3
    assert len(found) == 15
    width = values[frozenset(("plane +x", "plane -x"))]
    assert width["cold"] == pytest.approx(20.0, abs=1e-9)
    assert width["measured"] == pytest.approx(20.01, abs=1e-9)
    angle = values[frozenset(("plane +x", "plane +y"))]
    assert angle["cold"] == pytest.approx(90.0, abs=1e-9)
    assert abs(angle["measured"] - 90.0) == pytest.approx(0.1, abs=1e-9)


def test_a_relation_has_the_doubts_of_its_planes_alone() -> None:
    """A correction by another air scatters a plane's points; a circle of them hides that."""
    part = box()
    points, face = part.surface.even_places(3000)
    top = part.region_of_face[face] == part.region_names.index("plane +z")
    error = np.zeros_like(points)
    error[top, 2] = np.random.default_rng(2).normal(0.0, 0.01, top.sum())
    found = Correction(
        *(points, error, np.zeros(len(points), dtype=np.int64), face),
        *(part.face_normals, "fringe"),
        provenance={},
    )
    choices = ["plane:plane +z", "plane:plane -z", "circle:plane +z"]
    with pytest.warns(IriftraceWarning):
        features = found.features(part, choices, gate=None)
    assert [one.doubts for one in features] == [(OTHER_AIR,), (), ()]
    (height,) = found.relations(features)
    assert height.value.uncertainty is not None
    assert OTHER_AIR in height.value.uncertainty.missing


def test_an_angle_does_not_depend_on_the_rank_of_equal_components() -> None:
    """A box turned by 45 degrees: two faces 0.1 degrees off square, in clouds and members."""
    part = box()
    points, face = part.surface.even_places(3000)
    leaning = np.array(part.region_names)[part.region_of_face[face]] == "plane +x"
    points[leaning] = Rotation.from_euler("z", 0.1, degrees=True).apply(points[leaning])
    turned = [
        Rotation.from_euler("z", 45.0 + angle, degrees=True).apply(points)
        for angle in (-1e-6, 1e-6)
    ]
    clouds = {"cold": turned[0], "measured": turned[1]}
    found = relations(fit_features(clouds, face, part, PLANES, turned, gate=None))
    (value,) = (one.value for one in found if set(one.regions) == {"plane +x", "plane +y"})
    angle = value.by_cloud["cold"]
    assert abs(angle - 90.0) == pytest.approx(0.1, abs=1e-9)
    assert [value.by_cloud["measured"], *value.by_member] == pytest.approx([angle] * 3, abs=1e-9)


def test_uncertainties_are_those_of_repeated_measurements() -> None:
    """Noise of 10 um on two faces of which different ends were seen: 300 draws, to a tenth."""
    part = box()
    points, face = part.surface.even_places(1500)
    names = np.array(part.region_names)[part.region_of_face[face]]
    seen = (names == "plane +x") & (points[:, 2] > 5.0)
    seen |= (names == "plane -x") & (points[:, 2] < -5.0)
    seen |= (names == "plane +y") & (points[:, 0] > 0.0)
    points, face = points[seen], face[seen]
    rng = np.random.default_rng(3)
    drawn: dict[str, list[tuple[float, float]]] = {"distance": [], "angle": []}
    for _ in range(300):
        clouds = {"measured": points + 0.01 * rng.normal(size=points.shape)}
        for each in relations(fit_features(clouds, face, part, PLANES, gate=None)):
            value = each.value
            drawn[each.kind].append((value.by_cloud["measured"], value.u["measured"]))
    distance, angle = np.array(drawn["distance"]), np.array(drawn["angle"])[::2]
    for values in (distance, angle):
        assert values[:, 1].mean() == pytest.approx(values[:, 0].std(ddof=1), rel=0.1)


SENSOR = Contribution("sensor", 3.0, "B", "stated")
EXACT = Uncertainty(9.0, (), (9.0, 9.0))


@pytest.mark.parametrize(
    "value",
    [
        Quantity("mm", {"cold": 9.0, "measured": 9.1}, {"cold": None, "measured": 0.1}),
        Quantity("deg", {"cold": 9.0}, {"cold": 0.1}, (8.0, 9.5), 0.7, WorstMember(1, 8.0)),
        Quantity(
            *("mm", {"corrected": 9.0}, {"corrected": 0.1}, (8.0, 9.5), None, WorstMember(1, 8.0)),
            Uncertainty(9.0, (Contribution("air", 4.0, "A", "fit"), SENSOR), (-1.0, 19.0)),
            decide(Tolerance(9.0, -0.1, 0.1), EXACT, 9.0),
        ),
        Quantity(
            *("deg", {"corrected": 90.0, "drawing": 90.1}, {"corrected": 0.1}, (), None, None),
            Uncertainty(90.1, (SENSOR,), (84.1, 96.1), ("air", "growth")),
        ),
    ],
)
def test_values_are_read_back_from_json(value: Quantity) -> None:
    row = json.loads(json.dumps(Relation(("a", None), value).as_dict()))
    assert Quantity.of(row) == value
    assert row.get("U_mm") in (None, 10.0)
    assert row.get("value_deg") in (None, 90.1)


def test_regions_count_points_area_and_values() -> None:
    part = box()
    _, face = part.surface.even_places(600)
    top = part.region_names.index("plane +z")
    one = np.flatnonzero(part.region_of_face == top)[0]
    kept = (part.region_of_face[face] != top) | (face == one)
    values = np.where(part.region_of_face[face] == top, -2e-3, 1e-3)[kept]
    found = region_values(part, face[kept], values)
    assert [each.region for each in found] == list(part.region_names)
    assert sum(each.points for each in found) == kept.sum()
    assert found[top].measured == pytest.approx(0.5)
    assert found[top].along_normal_mm["median"] == -2e-3
    assert found[top].size_p95_mm == 2e-3
    assert found[top - 1].measured == pytest.approx(1.0)
    assert region_values(part, face[:0], values[:0])[top].along_normal_mm is None


def test_too_few_points_are_one_clean_sentence() -> None:
    part = box()
    points, face = part.surface.even_places(600)
    top = part.region_of_face[face] == part.region_names.index("plane +z")
    kept = ~top | (np.cumsum(top) == 1) & top
    said = r"plane:plane \+z is left out: 1 point was measured on it, and a plane needs at least 3;"
    top_plane = [FeatureChoice("plane", "plane +z")]
    with pytest.warns(IriftraceWarning, match=said):
        assert fit_features({"cold": points[kept]}, face[kept], part, top_plane, gate=None) == ()


def test_a_known_scatter_of_the_points_takes_the_place_of_their_own() -> None:
    """Of exact points of a box and a circle, against refits of noisy ones: JCGM 101 by hand."""
    part = box()
    points, face = part.surface.even_places(3000)
    (found, *_) = [
        one
        for one in relations(
            fit_features({"measured": points}, face, part, PLANES, gate=None, scatter_mm=0.01)
        )
        if one.kind == "distance"
    ]
    rng = np.random.default_rng(8)
    noisy = []
    for _ in range(100):
        clouds = {"measured": points + 0.01 * rng.normal(size=points.shape)}
        again = relations(fit_features(clouds, face, part, PLANES, gate=None))
        (same,) = [one for one in again if one.regions == found.regions]
        noisy.append(same.value.by_cloud["measured"])
    assert found.value.u["measured"] == pytest.approx(np.std(noisy, ddof=1), rel=0.25)
    turn = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    ring = 5.0 * np.column_stack((np.cos(turn), np.sin(turn), 0.0 * turn))
    sizes = [
        fit_feature(ring + 0.01 * rng.normal(size=ring.shape), "circle").size_mm for _ in range(400)
    ]
    stated = fit_feature(ring, "circle").with_scatter(0.01).u_size_mm
    assert stated == pytest.approx(np.std(sizes, ddof=1), rel=0.15)

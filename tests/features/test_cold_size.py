"""Sizes of a hot part at the temperature of its drawing, against the drawing."""

import numpy as np
import pytest
from attrs import evolve

from iriftrace.features.choice import FeatureChoice
from iriftrace.features.cold_size import ColdSizes
from iriftrace.features.fitted import fit_features
from iriftrace.features.quantity import AngleAtReference, SizeAtReference
from iriftrace.features.relations import relations
from iriftrace.part.growth import Growth
from iriftrace.part.part import Part, part_of_mesh
from iriftrace.part.shapes.cylinder import cylinder

STEEL = Growth(14e-6, 293.15, 1323.15)


def test_a_diameter_and_its_uncertainty() -> None:
    """60 mm at 20 degC are 60.8652 mm at 1050 degC; u is the scatter of 20,000 draws."""
    cold = cylinder(60.0, 120.0)
    part = evolve(cold, vertices=STEEL.factor * cold.vertices, growth=STEEL)
    face = np.flatnonzero(part.region_of_face == 0)
    face = np.repeat(face, 3)
    points = part.vertices[part.faces[face[::3]]].reshape(-1, 3)
    lateral = FeatureChoice("cylinder", "lateral")
    hot = fit_features({"corrected": points}, face, part, [lateral], gate=None)
    (found,) = ColdSizes(part, 0.02, 10.0).of_features(hot, "corrected")
    reference = found.size.at_reference
    assert found.size.by_cloud["corrected"] == pytest.approx(60.8652, abs=1e-6)
    assert reference.size_mm == pytest.approx(60.0, abs=1e-6)
    assert reference.holds_at_k == pytest.approx(1323.15, abs=1e-3)
    rng = np.random.default_rng(1)
    expansion = 14e-6 * (1 + 0.02 * rng.normal(size=20000))
    sizes = 60.8652 / (1 + expansion * (1030.0 + 10.0 * rng.normal(size=20000)))
    assert reference.expansion_uncertainty_mm == pytest.approx(2 * sizes.std(), rel=0.02)
    (found,) = ColdSizes(part, 0.02).of_features(hot, "corrected")
    assert found.size.at_reference.expansion_uncertainty_mm is None
    assert ColdSizes(cold).of_features(hot, "corrected") == hot


def test_distances_and_angles_follow_the_drawing() -> None:
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
    planes = [FeatureChoice("plane")]
    features = fit_features({"corrected": points}, face, part, planes, gate=None)
    found = ColdSizes(part, 0.02, 10.0).of_relations(relations(features), features, "corrected")
    cold = {frozenset(each.regions): each.value.at_reference for each in found}
    heights = cold[frozenset(("plane +z", "plane -z"))]
    assert isinstance(heights, SizeAtReference)
    assert heights.size_mm == pytest.approx(40.0, abs=1e-9)
    assert heights.holds_at_k == pytest.approx(293.15 + 2000.0)
    u = np.hypot(0.02 * 0.02, 1e-5 * 10.0) / 1.02
    assert heights.expansion_uncertainty_mm == pytest.approx(2 * 40.0 * u)
    angles = [each.angle_deg for each in cold.values() if isinstance(each, AngleAtReference)]
    assert len(angles) == 12
    np.testing.assert_allclose(angles, 90.0, atol=1e-9)
    leaning = [each.value.by_cloud["corrected"] - 90.0 for each in found if each.kind == "angle"]
    assert np.abs(leaning).max() == pytest.approx(0.1, rel=0.05)

"""Sentences on features: points that are left out of a simulated cloud are no outliers."""

import numpy as np
import pytest
import trimesh

from iriftrace.cli.triangulation_text import say_features
from iriftrace.features.fitted import fit_features
from iriftrace.part.part import part_of_mesh


@pytest.mark.parametrize(
    ("true", "moved", "said"),
    [("cold", 0.1, True), ("cold", 0.005, False), ("corrected", 0.1, False)],
)
def test_points_that_the_air_moves_are_not_called_outliers(
    capsys: pytest.CaptureFixture[str], true: str, moved: float, said: bool
) -> None:
    mesh = trimesh.creation.box((20.0, 20.0, 20.0))
    part = part_of_mesh(mesh.vertices, mesh.faces, name="block")
    points, face = part.surface.even_places(4000)
    top = np.flatnonzero(part.surface.normals[face, 2] > 0.9)
    top = top[np.abs(points[top, :2]).max(axis=1) < 9.0]
    cold, face = points[top], face[top]
    hot = cold + np.random.default_rng(1).normal(0.0, 1e-5, cold.shape)
    hot[: int(moved * len(hot)), 2] += 0.01
    features = fit_features({true: cold, "measured": hot}, face, part, ["plane"], gate=3.5)
    say_features(features, true, 3.5)
    printed = " ".join(capsys.readouterr().out.split())
    assert "points left out" in printed
    assert ("those that the air moves most (--gate none fits them, too)" in printed) is said

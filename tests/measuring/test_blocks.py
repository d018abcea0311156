"""Long clouds in blocks: the same numbers as in one piece, and little memory for each point."""

import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bench.measure import two_members
from iriftrace.core import blocks
from iriftrace.io.clouds import Cloud
from iriftrace.measuring.features.fit import fit_feature
from iriftrace.measuring.two_devices.budget import feature_budget
from iriftrace.measuring.two_devices.correct import correct
from iriftrace.measuring.two_devices.correction import Correction
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.scenes import folder_of
from iriftrace.tracing.load import load_scene
from iriftrace.tracing.scene import Scene

POINTS = 600_000
RNG = np.random.default_rng(1)


@pytest.fixture(scope="module")
def scene(variant: str) -> Scene:
    xml = folder_of("fringe_cylinder") / "scene.xml"
    return load_scene(xml, {"scale": 0.1}, variant=variant)


def test_blocks_of_packets_give_the_same_bits(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Noise, a table and points beside the part included; 1,024 rays fill whole packets."""
    points = measure(scene).points
    cloud = np.vstack(
        (points + RNG.normal(0.0, 0.01, points.shape), points[::30] + np.array((0.0, 0.0, 300.0)))
    )
    stated = Inputs(air=0.05, sensor_mm=0.008)
    whole = correct(cloud, scene, inputs=stated)
    monkeypatch.setattr(blocks, "BLOCK", 1000)
    monkeypatch.setattr(sys.modules[correct.__module__], "PIECE", 1024)
    parts = correct(cloud, scene, inputs=stated)
    for name in ("error", "status", "face", "normal", "u", "u_normal", "points", "to_part"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name), name)


@pytest.mark.parametrize("kind", ["plane", "line", "circle", "sphere", "cylinder", "cone"])
def test_a_fit_in_blocks_is_that_of_all_points(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    height, angle = RNG.uniform(-4.0, 4.0, 3000), RNG.uniform(0.0, 5.0, 3000)
    ring = np.column_stack((np.cos(angle), np.sin(angle), np.zeros_like(angle)))
    up = np.array((0.0, 0.0, 1.0))
    points = {
        "plane": 5.0 * ring + np.outer(height, ring[0]),
        "line": np.outer(height, up),
        "circle": 5.0 * ring,
        "sphere": np.sqrt(25.0 - height**2)[:, None] * ring + np.outer(height, up),
        "cylinder": 5.0 * ring + np.outer(height, up),
        "cone": (5.0 + 0.3 * height)[:, None] * ring + np.outer(height, up),
    }[kind] + RNG.normal(0.0, 0.01, (3000, 3))
    rows = np.flatnonzero(angle < 4.0)
    # A search ends where its sum of squares changes by less than its rounding, 1e-13.
    whole = fit_feature(points[rows], kind)
    monkeypatch.setattr(blocks, "BLOCK", 100)
    parts = fit_feature(points, kind, rows=rows)
    np.testing.assert_allclose(parts.position, whole.position, atol=1e-7)
    np.testing.assert_allclose(parts.residuals, whole.residuals, atol=1e-7)
    for name in ("size_mm", "u_size_mm", "half_angle", "scatter_mm"):
        expected = getattr(whole, name)
        assert expected is None or getattr(parts, name) == pytest.approx(expected, rel=1e-7), name


def peak(work: Callable[[], object]) -> float:
    """Bytes a point of a piece of work, beyond what there was before."""
    tracemalloc.start()
    try:
        work()
        return tracemalloc.get_traced_memory()[1] / POINTS
    finally:
        tracemalloc.stop()


@pytest.fixture(scope="module")
def large() -> Correction:
    part = load_scene(folder_of("fringe_cylinder") / "scene.xml").part
    points, face = part.surface.even_places(POINTS)
    return Correction(
        measured=points,
        error=RNG.normal(0.0, 1e-3, points.shape),
        status=np.zeros(POINTS, dtype=np.uint8),
        face=face.astype(np.int32),
        face_normals=part.surface.normals,
        system="fringe",
        provenance={"assumptions": {"field_origin": "none"}},
    )


@pytest.mark.parametrize("ending", [".ply", ".vtp"])
def test_a_cloud_is_written_without_a_copy(ending: str, large: Correction, tmp_path: Path) -> None:
    """The numbers need the sizes of the corrections, 32 bytes a point, and blocks 20 MB."""
    rows = Cloud(large.measured, np.ones(POINTS, dtype=bool), "mm", {})
    used = peak(lambda: large.save(tmp_path / f"cloud{ending}", cloud=rows))
    assert used < 32.0 + 20e6 / POINTS


def test_a_fit_needs_its_residuals_alone(large: Correction) -> None:
    """8 bytes a point, another 8 while its blocks are joined, and 30 MB for a block."""
    lateral = np.flatnonzero(np.abs(large.normal[:, 2]) < 0.5)
    used = peak(lambda: fit_feature(large.measured, "plane", rows=lateral))
    assert used < 16.0 + 30e6 / POINTS


def test_a_budget_reports_its_fields(scene: Scene) -> None:
    ensemble, seen = two_members(scene), []
    feature_budget(ensemble, progress=lambda *numbers: seen.append(numbers))
    assert seen == [(0, 2), (1, 2)]

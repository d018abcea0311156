"""Distance must not cost precision: a camera metres away sees the same noise floor."""

from pathlib import Path

import numpy as np
import pytest
from attrs import evolve

from iriftrace.scenes.analytic import slab
from iriftrace.tracing.rays import trace_rays
from validation.inputs.scene_rays import loaded


@pytest.mark.parametrize("distance_mm", [300.0, 10_000.0, 30_000.0])
@pytest.mark.usefixtures("variant")
def test_matched_shells_displace_nothing_from_afar(tmp_path: Path, distance_mm: float) -> None:
    """Flat shells and a flat part: straight hits are exact and matched shells change nothing."""
    part, shells = slab(13, size_mm=160.0)
    matched = evolve(
        shells, shells=[evolve(shell, ext=2.7e-4, int_=2.7e-4) for shell in shells.shells]
    )
    scene = loaded(tmp_path, part, matched)
    random = np.random.default_rng(5)
    targets = np.column_stack((random.uniform(-20, 20, (500, 2)), np.zeros(500)))
    direction = np.array((np.sin(1.0), 0.0, -np.cos(1.0))) + 1e-3 * random.normal(size=(500, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    hits = trace_rays(scene, targets - distance_mm * direction, direction)
    assert (hits.status == 0).all()
    assert np.linalg.norm(hits.straight - targets, axis=1).max() < 1e-9
    assert np.linalg.norm(hits.displacement, axis=1).max() < 1e-9

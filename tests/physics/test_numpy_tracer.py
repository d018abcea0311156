"""The real scene against an independent tracer: float64 NumPy, brute force over all triangles."""

import pytest

from validation.sections.noise_floor import oracle


@pytest.mark.usefixtures("variant")
def test_random_rays_of_the_real_scene_agree() -> None:
    """Random rays from all around, aimed at the part; hits within 1e-6 mm, crossings all equal."""
    hits, crossings = oracle(100)
    assert hits.bound == 1e-6
    assert hits.holds
    assert crossings.error == 0

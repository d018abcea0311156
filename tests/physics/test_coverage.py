"""The stated U of a corrected diameter holds in worlds that are drawn from what is stated."""

from __future__ import annotations

import numpy as np
import pytest

from validation.coverage import of_a_formula, statements


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::iriftrace.IriftraceWarning")
def test_true_diameters_lie_within_u() -> None:
    worlds = of_a_formula(24, np.random.default_rng(7))
    assert sum(one.holds for one in worlds) >= 20
    assert not any(one.outside for one in worlds)
    # U is not merely large.
    errors, expanded = ([getattr(w, name) for w in worlds] for name in ("error", "expanded"))
    assert np.median(expanded) < 6.0 * np.median(np.abs(errors))
    assert len(statements(worlds)) == 3

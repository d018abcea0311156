"""The sections of the page, in its order."""

from __future__ import annotations

from benchmarks.accuracy import agreement, air_effects, exact_shells, ledger, naive, noise_floor

SECTIONS = tuple(
    module.SECTION for module in (exact_shells, noise_floor, agreement, ledger, air_effects, naive)
)

"""The wall is judged: its temperature, its heat, and the cells on it."""

from __future__ import annotations

import numpy as np

from iriftrace.field_check.finding import Finding, Verdict
from iriftrace.field_check.wall_state import WallState
from iriftrace.part import Part

WALL_TOLERANCE_K = 0.5


def temperature_finding(wall: WallState, wanted_k: float | None) -> Finding:
    """Whether the wall has one temperature, the wanted one where it is given, K."""
    middle = float(np.median(wall.temperature_k))
    target = middle if wanted_k is None else wanted_k
    off = np.abs(wall.temperature_k - target)
    share = float(np.mean(off <= WALL_TOLERANCE_K))
    verdict: Verdict = "good" if share >= 0.99 else "doubtful" if share >= 0.9 else "bad"
    compared = "its own median" if wanted_k is None else f"the set {wanted_k:.2f} K"
    return Finding(
        "wall temperature",
        f"{middle:.2f} K",
        verdict,
        f"{share:.1%} of the wall's points within {WALL_TOLERANCE_K} K of {compared}; worst "
        f"{off.max():.3g} K (points at sharp edges may belong to two walls)",
        {"median_k": middle, "target_k": target, "share_within": share, "worst_k": off.max()},
    )


def layer_finding(wall: WallState) -> Finding:
    """How many cells resolve the boundary layer."""
    cells = wall.cells_across
    median, low = (float(v) for v in np.nanpercentile(cells, (50, 5)))
    layer = float(np.nanmedian(wall.layer_mm))
    first = float(np.nanmedian(wall.cell_mm))
    verdict: Verdict = "good" if median >= 5.0 else "doubtful" if median >= 3.0 else "bad"
    return Finding(
        "boundary layer",
        f"{median:.1f} cells",
        verdict,
        f"across its conduction thickness of {layer:.2f} mm, first cell {first:.2f} mm; 5th "
        f"percentile {low:.1f}; 5 keep the wall's gradient within some per cent",
        {"cells_median": median, "cells_p5": low, "layer_mm": layer, "first_cell_mm": first},
    )


def heat_finding(wall: WallState, part: Part) -> Finding:
    """Heat that the wall conducts into the air, and the regions with the largest flux."""
    region = part.region_of_face[wall.nearest_face]
    regions = {
        name: float(np.average(wall.flux[region == i], weights=wall.areas[region == i]))
        for i, name in enumerate(part.region_names)
        if wall.areas[region == i].sum() > 0.0
    }
    most = sorted(regions.items(), key=lambda item: -item[1])[:3]
    return Finding(
        "heat from the wall",
        f"{wall.heat_w:.4g} W",
        "-" if wall.heat_w > 0.0 else "bad",
        f"conducted through {wall.area_mm2:.5g} mm2, mean {wall.mean_flux:.4g} W/m2; "
        + ", ".join(f"{name} {flux:.4g}" for name, flux in most),
        {"heat_w": wall.heat_w, "flux_w_m2": wall.mean_flux, "regions_w_m2": regions},
    )

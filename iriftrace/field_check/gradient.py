"""The gradient of the index against the index itself, along straight lines from the wall."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.field_check.finding import Finding, Verdict
from iriftrace.field_check.wall_state import WallState
from iriftrace.index_field import IndexField

FloatArray = NDArray[np.float64]

_LINES = 400
_STEPS = 600
_FARTHEST_IN_LAYERS = 3.0
_STEEPEST_DEG = 45.0


@frozen(eq=False)
class GradientErrors:
    """Relative errors of the integral of grad(n) . d along lines, against the change of n."""

    errors: FloatArray

    @property
    def median(self) -> float:
        """Median; NaN without a line."""
        return float(np.median(self.errors)) if len(self.errors) else float("nan")

    @property
    def p95(self) -> float:
        """95th percentile; NaN without a line."""
        return float(np.percentile(self.errors, 95)) if len(self.errors) else float("nan")


def gradient_errors(field: IndexField, wall: WallState) -> GradientErrors:
    """Integrate the gradient along lines that start at the wall, up to 45 degrees from its normal.

    Lines that leave the data, or along which the index changes by less than a tenth of its whole
    range, are not counted.
    """
    random = np.random.default_rng(1)
    chosen = random.choice(len(wall.areas), _LINES, p=wall.areas / wall.areas.sum())
    layer = float(np.nanmedian(wall.layer_mm))
    normal = wall.normals[chosen]
    sideways = random.normal(size=(_LINES, 3))
    sideways -= np.einsum("ij,ij->i", sideways, normal)[:, None] * normal
    sideways /= np.linalg.norm(sideways, axis=1)[:, None]
    tilt = np.radians(random.uniform(0.0, _STEEPEST_DEG, _LINES))[:, None]
    direction = np.cos(tilt) * normal + np.sin(tilt) * sideways
    # Off the wall by a little, because coarse cells cut the part's own edges.
    start = wall.centres[chosen] + 0.02 * layer * normal
    path = _FARTHEST_IN_LAYERS * layer * direction
    along = (np.arange(_STEPS) + 0.5) / _STEPS
    points = start[:, None] + path[:, None] * along[:, None]
    carrier = field.grid.copy()
    carrier.point_data["gradient"] = field.gradient
    found = pv.PolyData(points.reshape(-1, 3)).sample(carrier)
    gradient = np.asarray(found.point_data["gradient"]).reshape(_LINES, _STEPS, 3)
    inside = np.asarray(found.point_data["vtkValidPointMask"]).reshape(_LINES, _STEPS).all(axis=1)
    integral = np.einsum("rsk,rk->r", gradient, path) / _STEPS
    change = field.sample(start + path) - field.sample(start)
    span = field.ambient_refractivity - field.hottest_refractivity
    with np.errstate(invalid="ignore"):
        counted = inside & np.isfinite(change) & (np.abs(change) > 0.1 * span)
    return GradientErrors(np.abs(integral[counted] / change[counted] - 1.0))


def gradient_finding(field: IndexField, wall: WallState) -> Finding:
    """Whether the gradient, along lines, adds up to the change of the index."""
    errors = gradient_errors(field, wall)
    if len(errors.errors) < 20:
        return Finding(
            "gradient",
            "n/a",
            "bad",
            f"only {len(errors.errors)} lines from the wall stay in the data; is there air around "
            "the part?",
            {"lines": len(errors.errors)},
        )
    fine = errors.median <= 0.02 and errors.p95 <= 0.1
    verdict: Verdict = "good" if fine else "doubtful" if errors.median <= 0.05 else "bad"
    return Finding(
        "gradient",
        f"{errors.median:.1%} off",
        verdict,
        f"median of |integral of grad n along a line / change of n - 1| over {len(errors.errors)} "
        f"lines; 95th percentile {errors.p95:.1%}; at most 2 % and 10 %",
        {"median": errors.median, "p95": errors.p95, "lines": len(errors.errors)},
    )

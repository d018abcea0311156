"""Gaussian best-fit features of points: least squares of the distances from the surface or curve.

As required by ISO 10360-6 for software of coordinate measuring machines: a closed-form start, then
Levenberg and Marquardt's method of SciPy.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple, get_args

import numpy as np
from attrs import evolve
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from iriftrace.core.arrays import FloatArray, IntArray, as_float64
from iriftrace.core.errors import InputError
from iriftrace.core.mesh.triangles import row_lengths, unit_vectors
from iriftrace.measuring.features.feature import Feature
from iriftrace.measuring.features.points import OfPoints, Points

FeatureKind = Literal["plane", "line", "circle", "sphere", "cylinder", "cone"]

EXACT, ROUGH = 1e-13, 1e-4
"""Relative changes of residuals and parameters at which a search ends, and one that only chooses
between the principal axes of a cylinder or cone."""

SAMPLE = 1000
"""Number of points used to choose between those axes, whose residuals differ by far."""

FEWEST = {"plane": 3, "line": 2, "circle": 3, "sphere": 4, "cylinder": 5, "cone": 6}
"""Smallest number of points that determine each kind of feature."""

DIMENSIONS = {"plane": 2, "line": 1, "circle": 2, "sphere": 3, "cylinder": 3, "cone": 3}
"""Dimensions in which those points must extend: points in a plane do not determine a sphere."""

FLAT = 1e-6
"""Rounding of single precision, as a fraction of the largest extent."""


def fit_feature(
    points: ArrayLike,
    kind: str,
    weights: FloatArray | None = None,
    near: Feature | None = None,
    rows: IntArray | None = None,
) -> Feature:
    """Fit a feature to points by least squares.

    Parameters
    ----------
    points : (n, 3) array, mm
    kind : str
        ``"plane"``, ``"line"``, ``"circle"``, ``"sphere"``, ``"cylinder"`` or ``"cone"``.
    weights : (m,) array, optional
        Weights of the squared distances; `u_size_mm` is right for equal ones, the default.
    near : Feature, optional
        A fit to nearly the same points; the search for an axis starts from its own, and the
        direction has its sense.
    rows : (m,) array of int, optional
        Numbers of the points that are fitted; all by default.

    Raises
    ------
    InputError
        If there are too few points, or they do not determine the feature.
    """
    places = np.asarray(points, dtype=np.float64)
    check_kind(kind)
    if places.ndim != 2 or places.shape[1] != 3:
        raise InputError(
            f"The points are an array of shape {places.shape}; give (n, 3), mm.",
            code="points.shape",
        )
    count = len(places) if rows is None else len(rows)
    if count < FEWEST[kind]:
        raise InputError(
            f"{count} points do not determine a {kind}; at least {FEWEST[kind]} points do.",
            code="feature.too_few_points",
        )
    unit = Points.of(places, rows, None if weights is None else np.sqrt(weights))
    scale = unit.scale
    if not scale > 0.0:
        raise InputError(
            f"All points are the same, so no {kind} fits; give others.", code="feature.one_point"
        )
    extents, axes = unit.principal
    if not extents[DIMENSIONS[kind] - 1] > FLAT * extents[0]:
        lying = "plane" if DIMENSIONS[kind] == 3 else "line"
        raise InputError(
            f"The {count:,} points lie on a {lying} and so do not determine a {kind}; give "
            "others, or another feature.",
            code="feature.undetermined",
        )
    if kind in ("cylinder", "cone"):
        known = None if near is None else near.direction
        found = _round(unit, axes if known is None else known[None], opening=kind == "cone")
    else:
        found = _FITS[kind](unit, axes)
    found = _signed(found, near)
    found.residuals[:] *= scale
    return evolve(
        found,
        position=unit.centre + scale * found.position,
        size_mm=None if found.size_mm is None else scale * found.size_mm,
        u_size_mm=None if found.u_size_mm is None else scale * found.u_size_mm,
        u_position_mm=None if found.u_position_mm is None else scale * found.u_position_mm,
        scatter_mm=None if found.scatter_mm is None else scale * found.scatter_mm,
    )


def check_kind(kind: str) -> None:
    """Raise InputError for an unknown kind of feature."""
    if kind not in get_args(FeatureKind):
        raise InputError(
            f"There is no feature {kind!r}; use one of {', '.join(get_args(FeatureKind))}, of "
            "a region such as cylinder:lateral.",
            code="feature.unknown_kind",
            argument="feature",
        )


def _signed(found: Feature, near: Feature | None) -> Feature:
    """The feature with the sense of a near fit, or else with the largest component positive."""
    direction = found.direction
    if direction is None or found.kind == "cone":
        return found
    if near is None or near.direction is None:
        along = direction[np.argmax(np.abs(direction))]
    else:
        along = direction @ near.direction
    if along >= 0.0:
        return found
    residuals = -found.residuals if found.kind == "plane" else found.residuals
    return evolve(found, direction=-direction, residuals=residuals)


def _plane(points: Points, axes: FloatArray) -> Feature:
    normal = axes[2]
    spread = np.square(points.factor(lambda p: p @ axes.T)).sum(axis=0)
    variance = _variance(float(spread[2]), len(points) - 3)
    weight = sum(float(np.sum(root**2)) for _, root in points)
    return Feature(
        kind="plane",
        position=np.zeros(3),
        direction=normal,
        size_mm=None,
        u_size_mm=None,
        half_angle=None,
        residuals=points.each(lambda p: p @ normal),
        u_position_mm=float(np.sqrt(variance / weight)),
        normal_covariance=variance * (axes[:2].T / spread[:2]) @ axes[:2],
        scatter_mm=float(np.sqrt(variance)),
    )


def _line(points: Points, axes: FloatArray) -> Feature:
    axis = axes[0]
    off = points.each(lambda p: row_lengths(np.cross(p, axis)))
    return Feature("line", np.zeros(3), axis, None, None, None, off)


def _solution(points: Points, columns: OfPoints) -> FloatArray:
    """Linear least squares: factors of all columns but the last, whose sum is nearest to it."""
    triangle = points.factor(columns)
    return as_float64(np.linalg.lstsq(triangle[:, :-1], triangle[:, -1], rcond=None)[0])


def _algebraic_sphere(points: Points, onto: FloatArray) -> tuple[FloatArray, float]:
    """Centre and radius by linear least squares of x^2 = 2 c x + r^2 - c^2.

    The points have the coordinates x along the (k, 3) directions `onto`.
    """

    def columns(block: FloatArray) -> FloatArray:
        x = block @ onto.T
        return np.column_stack((2 * x, np.ones(len(x)), np.einsum("ij,ij->i", x, x)))

    found = _solution(points, columns)
    centre, rest = found[:-1], found[-1]
    return centre, float(np.sqrt(max(rest + centre @ centre, 0.0)))


_Of = Callable[[FloatArray, FloatArray], FloatArray]
"""Function of points (n, 3) about 0 and a feature's p parameters."""


def _solved(
    points: Points,
    columns: _Of,
    start: Sequence[float],
    radius: int,
    exact: float = EXACT,
    each: int = 1,
) -> tuple[FloatArray, float, float]:
    """Parameters of least squares, u of twice the radius, and the scatter that it is by.

    `columns` (m, p + 1) are the derivatives of the residuals and, last, the residuals, of which
    each point has so many; `radius` is the parameter's number. The search needs only lengths and
    angles of these columns, so it is given their triangular factor.
    """
    last: dict[bytes, FloatArray] = {}

    def factor(values: FloatArray) -> FloatArray:
        key = values.tobytes()
        if key not in last:
            last.clear()
            last[key] = points.factor(lambda p: columns(p, values))
        return last[key]

    found = least_squares(
        lambda v: factor(v)[:, -1],
        start,
        jac=lambda v: factor(v)[:, :-1],
        method="lm",
        **dict.fromkeys(("xtol", "ftol", "gtol"), exact),
    )
    scatter = float(np.sqrt(_variance(2 * found.cost, each * len(points) - len(start))))
    inverse = np.linalg.pinv(found.jac)[radius]
    doubt = 2 * scatter * float(np.linalg.norm(inverse))
    return np.asarray(found.x, dtype=np.float64), doubt, scatter


def _variance(squares: float, freedom: int) -> float:
    """Variance of a point, never 0, so that another one can take its place."""
    return max(squares / max(freedom, 1), 1e-40)


def _sphere(points: Points, _: FloatArray) -> Feature:
    centre, radius = _algebraic_sphere(points, np.eye(3))

    def columns(block: FloatArray, values: FloatArray) -> FloatArray:
        arm = block - values[:3]
        outward, ones = unit_vectors(arm), np.ones(len(arm))
        return np.column_stack((-outward, -ones, row_lengths(arm) - values[3]))

    best, doubt, s = _solved(points, columns, (*centre, radius), radius=3)
    off = points.each(lambda p: row_lengths(p - best[:3]) - best[3])
    return Feature("sphere", best[:3], None, 2 * float(best[3]), doubt, None, off, scatter_mm=s)


def _frame(axis: FloatArray) -> FloatArray:
    """Rows: two directions across an axis, and the axis."""
    helper = np.eye(3)[np.argmin(np.abs(axis))]
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first)
    return np.array((first, np.cross(axis, first), axis))


def _tilted(frame: FloatArray, tilt: FloatArray) -> FloatArray:
    """The frame's axis leaned by small components along its two other directions."""
    axis: FloatArray = frame[2] + tilt @ frame[:2]
    return axis / np.linalg.norm(axis)


def _circle(points: Points, axes: FloatArray) -> Feature:
    frame = _frame(axes[2])
    centre, radius = _algebraic_sphere(points, frame[:2])

    def columns(block: FloatArray, values: FloatArray) -> FloatArray:
        """Those of the distance from the axis above those of the height above the plane."""
        normal = _tilted(frame, values[3:5])
        length = np.linalg.norm(frame[2] + values[3:5] @ frame[:2])
        leaning = (frame[:2] - np.outer(frame[:2] @ normal, normal)) / length
        arm = block - values[:3]
        height = arm @ normal
        across = arm - np.outer(height, normal)
        outward = unit_vectors(across)
        radial, level = np.zeros((2, len(block), 7))
        radial[:, :3], radial[:, 3:5] = -outward, -height[:, None] * (outward @ leaning.T)
        radial[:, 5], radial[:, 6] = -1.0, row_lengths(across) - values[5]
        level[:, :3], level[:, 3:5], level[:, 6] = -normal, across @ leaning.T, height
        return np.vstack((radial, level))

    start = (*(centre @ frame[:2]), 0.0, 0.0, radius)
    best, doubt, s = _solved(points, columns, start, radius=5, each=2)
    off = points.each(lambda p: np.hypot(*np.split(columns(p, best)[:, 6], 2)))
    normal = _tilted(frame, best[3:5])
    size = 2 * float(best[5])
    return Feature("circle", best[:3], normal, size, doubt, None, off, scatter_mm=s)


class _Round(NamedTuple):
    """Where points are about the axis of a cylinder or cone."""

    frame: FloatArray
    axis: FloatArray  # (3,) not of unit length
    arm: FloatArray  # (n, 3) from a point of the axis
    height: FloatArray  # (n,) along the axis
    across: FloatArray  # (n, 3) from the axis
    distance: FloatArray  # (n,) from the axis
    values: FloatArray

    @property
    def cosine_sine(self) -> FloatArray:
        angle = self.values[5] if len(self.values) > 5 else 0.0
        return np.array((np.cos(angle), np.sin(angle)))

    @property
    def residuals(self) -> FloatArray:
        """Distances (n,) from the surface."""
        cosine, sine = self.cosine_sine
        return np.asarray((self.distance - self.values[4]) * cosine - self.height * sine)

    @property
    def columns(self) -> FloatArray:
        """Derivatives of the residuals by the 5 or 6 parameters, and the residuals."""
        cosine, sine = self.cosine_sine
        length = np.linalg.norm(self.axis)
        sides, along = self.frame[:2].T, self.axis @ self.frame[:2].T / length
        outward = self.across @ sides / np.maximum(self.distance, FLAT**2)[:, None]
        rise = self.arm @ sides - np.outer(self.height, along)
        columns = (
            sine * along - cosine * outward,
            -(cosine * self.height[:, None] * outward + sine * rise) / length,
            np.full(len(rise), -cosine),
            -(self.distance - self.values[4]) * sine - self.height * cosine,
        )
        slopes = columns[: len(self.values) - 2]
        return np.column_stack((*slopes, self.residuals))


def _round_of(points: FloatArray, frame: FloatArray, values: FloatArray) -> _Round:
    """Points about 0 and a surface whose axis is near that of a frame.

    Its parameters are two coordinates of a point of the axis, two of the axis' lean, the radius
    there, and for a cone the angle.
    """
    axis = frame[2] + values[2:4] @ frame[:2]
    unit = axis / np.linalg.norm(axis)
    arm = points - values[:2] @ frame[:2]
    height = arm @ unit
    across = arm - np.outer(height, unit)
    return _Round(frame, axis, arm, height, across, row_lengths(across), values)


def _about_axis(points: Points, axis: FloatArray, opening: bool, exact: float = EXACT) -> Feature:
    """Cylinder or cone from a first guess of its axis."""
    frame = _frame(axis)
    centre, radius = _algebraic_sphere(points, frame[:2])

    def opened(block: FloatArray) -> FloatArray:
        across = block @ frame[:2].T - centre
        return np.column_stack((block @ axis, np.ones(len(block)), row_lengths(across)))

    start = [*centre, 0.0, 0.0, radius]
    if opening:
        start.append(float(np.arctan(_solution(points, opened)[0])))
    best, doubt, s = _solved(
        points,
        lambda p, v: _round_of(p, frame, v).columns,
        start,
        radius=4,
        exact=exact,
    )
    direction = _tilted(frame, best[2:4])
    foot = best[:2] @ frame[:2]
    # The point of the axis nearest to the points' centre, which is the origin.
    position = foot - (foot @ direction) * direction
    angle = float(best[5]) if opening else 0.0
    size = 2 * float(best[4] + np.tan(angle) * float((position - foot) @ direction))
    off = points.each(lambda p: _round_of(p, frame, best).residuals)
    if not opening:
        return Feature("cylinder", position, direction, size, doubt, None, off, scatter_mm=s)
    wide = direction if angle >= 0.0 else -direction
    return Feature("cone", position, wide, size, doubt, abs(angle), off, scatter_mm=s)


def _round(points: Points, axes: FloatArray, opening: bool) -> Feature:
    """Fit from the axis, of some (k, 3), along which a sample of the points fits best."""
    axis = axes[0]
    if len(axes) > 1:
        sample = points.every(max(1, len(points) // SAMPLE))
        weight = np.concatenate([root**2 for _, root in sample])
        fits = [_about_axis(sample, axis, opening, ROUGH) for axis in axes]
        best = min(fits, key=lambda fit: float(weight @ fit.residuals**2))
        axis = axes[0] if best.direction is None else best.direction
    return _about_axis(points, axis, opening)


_FITS: dict[str, Callable[[Points, FloatArray], Feature]] = {
    "plane": _plane,
    "line": _line,
    "circle": _circle,
    "sphere": _sphere,
}

"""Gaussian best-fit features of points: least squares of the distances from the surface or curve.

As ISO 10360-6 asks of software for coordinate measuring machines. A start in closed form, then
Levenberg and Marquardt's method by SciPy. Outliers of measured points are left out by a gate of
robust standard deviations.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import chain
from typing import Any, Literal, get_args

import numpy as np
from attrs import evolve, frozen
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.part.part import Part

Kind = Literal["plane", "line", "circle", "sphere", "cylinder", "cone"]

SAMPLE = 1000
"""Points that choose between the principal axes of a cylinder or cone, which differ by far."""

FOUND_KINDS: tuple[Kind, ...] = ("plane", "cylinder", "cone", "sphere")
"""Surfaces that regions are taken for, the first that fits: a plane fits as a wide cylinder too, a
cylinder as a cone, and two rings of corners lie on a sphere whatever they belong to."""

FOUND_SHARE = 1e-3
"""Of a region's extent: farthest off a surface a region may be that is one. Files in single
precision are off by 1e-7, free-form regions by some percent."""

NO_FEATURE = 0.1
"""Form deviation as a share of the extent beyond which a fitted feature means nothing."""

FEWEST_MEASURED = 100
"""Measured points of a region for a feature of its own; metrics ask for as many rays."""

GATE = 3.5
"""Robust standard deviations beyond which a point is an outlier: a choice. One of 2,150 points of
normal noise is beyond, and would have changed a standard deviation by 0.3 %."""

LEAST_GATE = 1.0

NORMAL_MAD = 1.4826
"""Standard deviation of normal noise over the median of its sizes."""

ROUNDS = 20
"""Most rounds of the robust start and of the gate, which take three to eight."""

FEWEST = {"plane": 3, "line": 2, "circle": 3, "sphere": 4, "cylinder": 5, "cone": 6}
"""Points that determine each kind of feature."""

DIMENSIONS = {"plane": 2, "line": 1, "circle": 2, "sphere": 3, "cylinder": 3, "cone": 3}
"""Dimensions in which those points have an extent: on a plane lies no one sphere."""

SETTLED = 0.05
"""Of the noise: a robust fit that moves by less is good enough to judge outliers by."""

FLAT = 1e-6
"""Extent, as a share of the largest, that is the rounding of single precision."""


@frozen(eq=False)
class Feature:
    """A fitted feature.

    Attributes
    ----------
    kind : str
    position : (3,) array, mm
        Centre of a sphere or circle; else the point of plane or axis that is nearest to the points'
        centre.
    direction : (3,) array or None
        Unit normal of a plane or circle, unit axis of a line, cylinder or cone; none of a sphere.
        Its largest component is positive.
    size_mm : float or None, mm
        Diameter (of a cone at `position`); none of plane and line.
    u_size_mm : float or None, mm
        Standard uncertainty of the diameter by the residuals, as if they were independent: s times
        the root of its element of (J^T J)^-1, s^2 = residuals squared over degrees of freedom.
    half_angle : float or None, rad
        Of a cone.
    residuals : (n,) array, mm
        Signed distances, positive outwards; of a line or circle unsigned.
    """

    kind: str
    position: FloatArray
    direction: FloatArray | None
    size_mm: float | None
    u_size_mm: float | None
    half_angle: float | None
    residuals: FloatArray

    @property
    def form_mm(self) -> float:
        """Form deviation: the largest residual less the smallest."""
        return float(np.ptp(self.residuals))

    def distances(self, points: FloatArray) -> FloatArray:
        """Distances (n,) of points (n, 3), mm, from the feature, signed like the residuals."""
        arm = points - self.position
        radius = 0.5 * (self.size_mm or 0.0)
        if self.direction is None:
            return np.asarray(np.linalg.norm(arm, axis=1) - radius)
        height = arm @ self.direction
        if self.kind == "plane":
            return np.asarray(height)
        beside = np.linalg.norm(arm - np.outer(height, self.direction), axis=1) - radius
        if self.kind == "circle":
            return np.asarray(np.hypot(beside, height))
        if self.half_angle is None:
            return np.asarray(beside)
        # The direction does not tell to which side the cone opens; the points do.
        sides = (
            beside * np.cos(angle) - height * np.sin(angle)
            for angle in (self.half_angle, -self.half_angle)
        )
        return np.asarray(min(sides, key=lambda off: float(np.median(np.abs(off)))))


def fit_feature(
    points: ArrayLike,
    kind: str,
    weights: FloatArray | None = None,
    near: Feature | None = None,
) -> Feature:
    """Fit a feature to points by least squares.

    Parameters
    ----------
    points : (n, 3) array, mm
    kind : str
        ``"plane"``, ``"line"``, ``"circle"``, ``"sphere"``, ``"cylinder"`` or ``"cone"``.
    weights : (n,) array, optional
        Of the squared distances; `u_size_mm` is right for equal ones, the default.
    near : Feature, optional
        A fit to nearly the same points; the search for an axis starts from its own.

    Raises
    ------
    InputError
        If there are too few points, or they do not determine the feature.
    """
    places = np.asarray(points, dtype=np.float64)
    _check_kind(kind)
    if places.ndim != 2 or places.shape[1] != 3:
        raise InputError(f"The points are an array of shape {places.shape}; give (n, 3), mm.")
    if len(places) < FEWEST[kind]:
        raise InputError(
            f"{len(places)} points do not determine a {kind}; at least {FEWEST[kind]} points do."
        )
    root = np.ones(len(places)) if weights is None else np.sqrt(weights)
    centre = np.average(places, axis=0, weights=root**2)
    scale = float(np.abs(places - centre).max())
    if not scale > 0.0:
        raise InputError(f"All points are the same, so they are no {kind}; give others.")
    # About their centre and of size 1, so that all parameters weigh alike.
    unit = (places - centre) / scale
    extents = np.linalg.svd(root[:, None] * unit, compute_uv=False)
    if not extents[DIMENSIONS[kind] - 1] > FLAT * extents[0]:
        lying = "plane" if DIMENSIONS[kind] == 3 else "line"
        raise InputError(
            f"The {len(places):,} points lie on a {lying} and so do not determine a {kind}; give "
            "others, or another feature."
        )
    if kind in ("cylinder", "cone"):
        known = None if near is None else near.direction
        axes = _axes(unit, root) if known is None else known[None]
        found = _round(unit, root, axes, opening=kind == "cone")
    else:
        found = _FITS[kind](unit, root)
    return evolve(
        found,
        position=centre + scale * found.position,
        size_mm=None if found.size_mm is None else scale * found.size_mm,
        u_size_mm=None if found.u_size_mm is None else scale * found.u_size_mm,
        residuals=scale * found.residuals,
    )


def check_gate(gate: float | None) -> None:
    """Refuse a gate that leaves out half of the points or is no number."""
    if gate is not None and not gate >= LEAST_GATE:
        raise InputError(
            f"The gate is {gate:g} robust standard deviations, which leaves out good points; give "
            f"at least {LEAST_GATE:g}, or none for all points (--gate)."
        )


def inliers(points: FloatArray, kind: str, gate: float | None) -> BoolArray:
    """Mask (n,) of the points (n, 3), mm, that are no outliers of a feature; all without a gate.

    They lie within `gate` robust standard deviations, 1.4826 times the median distance, of the
    least-squares fit to themselves: from a robust fit on, points are left out and the rest fitted
    again until the set stands.
    """
    if gate is None or len(points) < 2 * FEWEST[kind]:
        return np.ones(len(points), dtype=bool)
    # Of points without noise, the rounding of single precision is no outlier.
    least = FLAT * float(np.ptp(points, axis=0).max())
    found = _robust_fit(points[:: max(1, len(points) // SAMPLE)], kind, least)
    kept = np.zeros(len(points), dtype=bool)
    for _ in range(ROUNDS):
        off = np.abs(found.distances(points))
        before, kept = kept, off <= max(gate * NORMAL_MAD * float(np.median(off)), least)
        if np.array_equal(kept, before):
            break
        found = fit_feature(points[kept], kind, near=found)
    return kept


def _robust_fit(points: FloatArray, kind: str, least: float) -> Feature:
    """Fit that outliers hardly change: the loss soft_l1 by reweighted least squares."""
    found = fit_feature(points, kind)
    for _ in range(ROUNDS):
        off = found.distances(points)
        scale = NORMAL_MAD * float(np.median(np.abs(off)))
        if scale <= least:
            break
        found = fit_feature(points, kind, 1.0 / np.sqrt(1.0 + (off / scale) ** 2), found)
        if np.abs(found.distances(points) - off).max() < SETTLED * scale:
            break
    return found


def feature_table(
    clouds: Mapping[str, FloatArray],
    face: IntArray,
    part: Part,
    choices: Sequence[str],
    by_member: Iterable[FloatArray] = (),
    gate: float | None = GATE,
) -> list[dict[str, Any]]:
    """Fit features to the same (n, 3) points, mm, as they are in several clouds, by name.

    `face` (n,) is the part's face on which each point lies. A choice is a kind of feature and a
    region, ``"cylinder:lateral"``; ``"sphere:"`` is for all points; a kind alone for all regions
    that are one, and of a part of one region for all points. Without any choice, `found_features`.
    Warns of points that are no such feature or leave its diameter uncertain, and leaves out what
    they do not determine.

    Outliers of the cloud ``"measured"`` (else of the first) by `inliers` are left out of all.

    Gives ``kind``, ``region``, ``points`` that were fitted and ``left_out``, and by cloud
    ``size_mm``, ``u_size_mm``, ``form_mm``, ``position_mm`` and ``direction`` as in `Feature`; with
    the same points by each member of an ensemble also ``size_by_member_mm``, None for a feature
    without a size.
    """
    check_choices(choices, part)
    check_gate(gate)
    gated = clouds.get("measured", next(iter(clouds.values())))
    members = list(by_member)
    found = found_features(part, face)
    rows = []
    several = len(part.region_names) > 1
    for choice in chain.from_iterable(_regions_of(choice, found) for choice in choices or found):
        kind, region, mask = chosen_points(choice, face, part)
        chosen = np.flatnonzero(mask)
        count = len(chosen)
        try:
            if several and ":" not in choice:
                raise InputError(
                    f"No region that is one has {FEWEST_MEASURED} measured points; those that have "
                    f"are {', '.join(found) or 'none'}."
                )
            chosen = chosen[inliers(gated[chosen], kind, gate)]
            fits = {name: fit_feature(cloud[chosen], kind) for name, cloud in clouds.items()}
        except InputError as error:
            warnings.warn(f"{choice} is left out: {error}", IriftraceWarning, stacklevel=3)
            continue
        doubts = (
            _doubt(fit, np.ptp(clouds[name][chosen], axis=0).max(), region, found)
            for name, fit in fits.items()
        )
        doubt = _other_surface(part, kind, region) or next(filter(None, doubts), None)
        if doubt:
            warnings.warn(doubt, IriftraceWarning, stacklevel=3)
        row: dict[str, Any] = {
            "kind": kind,
            "region": region or None,
            "points": len(chosen),
            "left_out": count - len(chosen),
            "size_mm": {name: fit.size_mm for name, fit in fits.items()},
            "u_size_mm": {name: fit.u_size_mm for name, fit in fits.items()},
            "form_mm": {name: fit.form_mm for name, fit in fits.items()},
            "position_mm": {name: fit.position.tolist() for name, fit in fits.items()},
            "direction": {
                name: None if fit.direction is None else fit.direction.tolist()
                for name, fit in fits.items()
            },
        }
        if members:
            sizes = [fit_feature(cloud[chosen], kind).size_mm for cloud in members]
            row["size_by_member_mm"] = None if None in sizes else sizes
        rows.append(row)
    return rows


def _other_surface(part: Part, kind: str, region: str) -> str | None:
    """Why a region's points are no surface of a kind, where it is one of another."""
    is_a = _kind_of_region(part, region) if region and kind in FOUND_KINDS else None
    if is_a is None or _lies_on(_corners(part, region), kind):
        return None
    return f"The points of {region} are no {kind}, as that is a {is_a}; choose {is_a}:{region}."


def _doubt(fit: Feature, extent: float, region: str, found: Sequence[str]) -> str | None:
    """Why a feature of points of this extent, mm, means nothing or little; None where it does."""
    where = f"The points of {region or 'the whole part'}"
    if fit.form_mm > NO_FEATURE * extent:
        return (
            f"{where} are no {fit.kind}, as they lie {fit.form_mm:.3g} mm apart across the fitted "
            f"one; choose one of the part's features: {', '.join(found) or 'it has none'}."
        )
    if fit.u_size_mm is not None and fit.u_size_mm > fit.form_mm:
        return (
            f"{where} span too little of a {fit.kind}: by their scatter alone its diameter of "
            f"{fit.size_mm:.5g} mm is uncertain by {fit.u_size_mm:.2g} mm (k = 1), more than their "
            "form deviation; measure more of its circumference."
        )
    return None


def check_choices(choices: Iterable[str], part: Part) -> None:
    """An InputError for a choice of `feature_table` whose kind or region there is not."""
    for choice in choices:
        kind = choice.partition(":")[0]
        if choice in part.region_names and kind not in get_args(Kind):
            is_a = _kind_of_region(part, choice) or "cylinder"
            raise InputError(
                f"A feature is a kind of surface and a region; give such as {is_a}:{choice}."
            )
        _check_kind(kind)
        chosen_points(choice, np.empty(0, dtype=np.int64), part)
        if ":" not in choice and len(part.region_names) > 1:
            kinds = {name: _kind_of_region(part, name) for name in part.region_names}
            if kind not in kinds.values():
                known = [f"{found}:{name}" for name, found in kinds.items() if found]
                raise InputError(
                    f"No region of the part is a {kind}; name the region whose points it shall be "
                    f"fitted to ({kind}:REGION, or {kind}: for all points), or choose one of what "
                    f"there is: {', '.join(known) or 'no simple surface'}."
                )


def _check_kind(kind: str) -> None:
    if kind not in get_args(Kind):
        raise InputError(
            f"There is no feature {kind!r}; use one of {', '.join(get_args(Kind))}, of a region "
            "such as cylinder:lateral."
        )


def _regions_of(choice: str, found: Sequence[str]) -> list[str]:
    """The features of a choice; all of its kind that were found, if it names no region."""
    same = [one for one in found if one.partition(":")[0] == choice]
    return same or [choice]


def chosen_points(choice: str, face: IntArray, part: Part) -> tuple[str, str, BoolArray]:
    """Kind, region ("" for all of the part) and mask (n,) of the points of a feature.

    Choice and face as for `feature_table`.
    """
    kind, _, region = choice.partition(":")
    if not region:
        return kind, region, np.ones(len(face), dtype=bool)
    if region not in part.region_names:
        raise InputError(
            f"The part has no region {region!r}; use one of {', '.join(part.region_names)}."
        )
    return kind, region, part.region_of_face[face] == part.region_names.index(region)


def found_features(part: Part, face: IntArray) -> list[str]:
    """Features that regions of a part are: ``"cylinder:lateral"``.

    Regions on whose faces (n,) fewer than `FEWEST_MEASURED` points were measured are left out.
    """
    region = part.region_of_face
    measured = np.bincount(region[face], minlength=len(part.region_names))
    found = []
    for number in np.flatnonzero(measured >= FEWEST_MEASURED):
        kind = _kind_of_region(part, part.region_names[number])
        if kind is not None:
            found.append(f"{kind}:{part.region_names[number]}")
    return found


def _kind_of_region(part: Part, name: str) -> str | None:
    """Kind of surface that a region is, None where it is none of `FOUND_KINDS`."""
    return surface_kind(_corners(part, name))


def _corners(part: Part, region: str) -> FloatArray:
    """Vertices of a region, (n, 3), mm."""
    faces = part.faces[part.region_of_face == part.region_names.index(region)]
    corners: FloatArray = part.vertices[np.unique(faces)]
    return corners


def surface_kind(corners: FloatArray) -> str | None:
    """Kind of surface that corners (n, 3) of a region lie on: one of `FOUND_KINDS`, or None."""
    return next((kind for kind in FOUND_KINDS if _lies_on(corners, kind)), None)


def _lies_on(corners: FloatArray, kind: str) -> bool:
    """True if corners (n, 3) lie on a surface of a kind, and are enough to tell."""
    sample = corners[:: max(1, len(corners) // SAMPLE)]
    allowed = FOUND_SHARE * float(np.ptp(sample, axis=0).max())
    # A surface through any points tells nothing.
    enough = kind == "plane" or len(sample) > 2 * FEWEST[kind]
    return enough and fit_feature(sample, kind).form_mm <= allowed


def _axes(points: FloatArray, root: FloatArray) -> FloatArray:
    """Principal axes of points about 0, as rows, that of the largest extent first.

    Here and below `root` (n,) has the roots of the points' weights.
    """
    axes: FloatArray = np.linalg.svd(root[:, None] * points, full_matrices=False)[2]
    return axes


def _signed(direction: FloatArray) -> FloatArray:
    signed: FloatArray = direction * np.sign(direction[np.argmax(np.abs(direction))])
    return signed


def _plane(points: FloatArray, root: FloatArray) -> Feature:
    normal = _signed(_axes(points, root)[2])
    return Feature("plane", np.zeros(3), normal, None, None, None, points @ normal)


def _line(points: FloatArray, root: FloatArray) -> Feature:
    axis = _signed(_axes(points, root)[0])
    off = np.linalg.norm(np.cross(points, axis), axis=1)
    return Feature("line", np.zeros(3), axis, None, None, None, off)


def _algebraic_sphere(points: FloatArray, root: FloatArray) -> tuple[FloatArray, float]:
    """Centre and radius by linear least squares of x^2 = 2 c x + r^2 - c^2, in any dimension."""
    squares = np.einsum("ij,ij->i", points, points)
    system = np.column_stack((2 * points, np.ones(len(points))))
    found = np.linalg.lstsq(root[:, None] * system, root * squares, rcond=None)[0]
    centre, rest = found[:-1], found[-1]
    return centre, float(np.sqrt(max(rest + centre @ centre, 0.0)))


def _solved(
    residuals: Callable[[FloatArray], FloatArray], start: Sequence[float], radius: int
) -> tuple[FloatArray, float]:
    """Parameters of least squares, to 1e-12 of the points' extent, and u of twice the radius.

    `radius` is the parameter's number.
    """
    exact = 1e-13
    found = least_squares(residuals, start, method="lm", xtol=exact, ftol=exact, gtol=exact)
    variance = 2 * found.cost / max(len(found.fun) - len(start), 1)
    inverse = np.linalg.pinv(found.jac.T @ found.jac)[radius, radius]
    return np.asarray(found.x, dtype=np.float64), 2 * float(np.sqrt(variance * inverse))


def _sphere(points: FloatArray, root: FloatArray) -> Feature:
    centre, radius = _algebraic_sphere(points, root)

    def residuals(values: FloatArray) -> FloatArray:
        return np.asarray(np.linalg.norm(points - values[:3], axis=1) - values[3])

    best, doubt = _solved(lambda v: root * residuals(v), (*centre, radius), radius=3)
    return Feature("sphere", best[:3], None, 2 * float(best[3]), doubt, None, residuals(best))


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


def _circle(points: FloatArray, root: FloatArray) -> Feature:
    frame = _frame(_axes(points, root)[2])
    centre, radius = _algebraic_sphere(points @ frame[:2].T, root)

    def parts(values: FloatArray) -> tuple[FloatArray, FloatArray]:
        normal = _tilted(frame, values[3:5])
        arm = points - values[:3]
        height = arm @ normal
        return np.linalg.norm(arm - np.outer(height, normal), axis=1) - values[5], height

    start = (*(centre @ frame[:2]), 0.0, 0.0, radius)
    twice = np.tile(root, 2)
    best, doubt = _solved(lambda v: twice * np.concatenate(parts(v)), start, radius=5)
    off = np.hypot(*parts(best))
    normal = _signed(_tilted(frame, best[3:5]))
    return Feature("circle", best[:3], normal, 2 * float(best[5]), doubt, None, off)


def _about_axis(points: FloatArray, root: FloatArray, axis: FloatArray, opening: bool) -> Feature:
    """Cylinder or cone from a first guess of its axis."""
    frame = _frame(axis)
    across = points @ frame[:2].T
    centre, radius = _algebraic_sphere(across, root)
    slope = np.polyfit(points @ axis, np.linalg.norm(across - centre, axis=1), 1, w=root)[0]

    def residuals(values: FloatArray) -> FloatArray:
        direction = _tilted(frame, values[2:4])
        arm = points - values[:2] @ frame[:2]
        height = arm @ direction
        distance = np.linalg.norm(arm - np.outer(height, direction), axis=1)
        if not opening:
            return np.asarray(distance - values[4])
        angle = values[5]
        return np.asarray((distance - values[4]) * np.cos(angle) - height * np.sin(angle))

    start = [*centre, 0.0, 0.0, radius, *([float(np.arctan(slope))] if opening else [])]
    best, doubt = _solved(lambda v: root * residuals(v), start, radius=4)
    direction = _tilted(frame, best[2:4])
    foot = best[:2] @ frame[:2]
    # The point of the axis nearest to the points' centre, which is the origin.
    position = foot - (foot @ direction) * direction
    angle = float(best[5]) if opening else 0.0
    diameter = 2 * (best[4] + np.tan(angle) * float((position - foot) @ direction))
    kind, half_angle = ("cone", abs(angle)) if opening else ("cylinder", None)
    off = residuals(best)
    return Feature(kind, position, _signed(direction), float(diameter), doubt, half_angle, off)


def _round(points: FloatArray, root: FloatArray, axes: FloatArray, opening: bool) -> Feature:
    """Fit from the axis, of some (k, 3), along which a sample of the points fits best."""
    step = max(1, len(points) // SAMPLE) if len(axes) > 1 else 1
    sample, weight = points[::step], root[::step] ** 2
    fits = [_about_axis(sample, root[::step], axis, opening) for axis in axes]
    best = min(fits, key=lambda fit: float(weight @ fit.residuals**2))
    if step == 1 or best.direction is None:
        return best
    return _about_axis(points, root, best.direction, opening)


_FITS: dict[str, Callable[[FloatArray, FloatArray], Feature]] = {
    "plane": _plane,
    "line": _line,
    "circle": _circle,
    "sphere": _sphere,
}

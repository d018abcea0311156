"""Lens distortion by Brown and Conrady, in OpenCV's form, and its inverse.

Everything is in normalised coordinates x/z, y/z of the camera frame. :func:`distorted`,
:func:`jacobian` and :func:`newton_step` are plain arithmetic, so that they serve NumPy and Dr.Jit
arrays alike.

A fitted polynomial is valid in the picture it was fitted to. Farther out it may turn back: several
directions would then be seen at one position of the picture. The disk around the axis up to the
first such turn is the *fold radius*; only directions inside it count as seen.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np
from attrs import astuple, field, frozen
from numpy.typing import ArrayLike

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError

ORDER = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
"""OpenCV's order of the coefficients; files hold the first 4, 5 or 8."""

MOST_ROUNDS = 30
"""Newton steps after which the inverse is taken not to exist."""

Numbers: TypeAlias = Any
"""Numbers, or arrays of NumPy or Dr.Jit, which have no common type."""

_CLOSE = 1e-9  # One more Newton step from here is exact in double precision.
_BLOCK = 1 << 14  # Positions worked on at a time, so that they stay in the processor's cache.


def _coefficient() -> float:
    return field(default=0.0, converter=float)


@frozen
class Distortion:
    """Coefficients of Brown and Conrady's model as OpenCV defines them.

    With ``r2 = x x + y y`` and ``radial = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 +
    k6 r2^3)``, a point at (x, y) appears at ``x radial + 2 p1 x y + p2 (r2 + 2 x x)`` and
    ``y radial + p1 (r2 + 2 y y) + 2 p2 x y`` (D. C. Brown, Photogramm. Eng. 37 (1971) 855; OpenCV's
    calib3d).

    Raises
    ------
    InputError
        If a coefficient is not finite.
    """

    k1: float = _coefficient()
    k2: float = _coefficient()
    p1: float = _coefficient()
    p2: float = _coefficient()
    k3: float = _coefficient()
    k4: float = _coefficient()
    k5: float = _coefficient()
    k6: float = _coefficient()

    def __attrs_post_init__(self) -> None:
        for name, value in self.as_dict().items():
            if not math.isfinite(value):
                raise InputError(
                    f"The lens distortion has {name} = {value}, so no ray is defined; give finite "
                    "coefficients.",
                    code="camera.distortion_not_finite",
                    argument="distortion",
                )

    @classmethod
    def of_sequence(cls, values: ArrayLike) -> Distortion:
        """Coefficients in OpenCV's order k1 k2 p1 p2 [k3 [k4 k5 k6]]."""
        flat = np.asarray(values, dtype=np.float64).ravel()
        if len(flat) not in (4, 5, 8):
            raise InputError(
                f"A lens distortion of {len(flat)} coefficients is given, which has no meaning; "
                "give 4, 5 or 8 in OpenCV's order k1, k2, p1, p2, k3, k4, k5, k6.",
                code="camera.distortion_count",
                argument="distortion",
            )
        return cls(*flat)

    @property
    def vanishes(self) -> bool:
        """True for no distortion at all."""
        return not any(self.coefficients)

    @property
    def coefficients(self) -> tuple[float, ...]:
        """All eight, in OpenCV's order."""
        return astuple(self)

    def as_dict(self) -> dict[str, float]:
        """Coefficients by name."""
        return dict(zip(ORDER, self.coefficients, strict=True))

    def __str__(self) -> str:
        return ", ".join(f"{name} {value:g}" for name, value in self.as_dict().items() if value)


def distorted(x: Numbers, y: Numbers, coefficients: Numbers) -> tuple[Numbers, Numbers]:
    """Where points at (x, y) appear; all normalised, numbers or arrays of NumPy or Dr.Jit."""
    k1, k2, p1, p2, k3, k4, k5, k6 = coefficients
    xx, yy, xy = x * x, y * y, x * y
    r2 = xx + yy
    radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    return (
        x * radial + 2.0 * p1 * xy + p2 * (r2 + 2.0 * xx),
        y * radial + p1 * (r2 + 2.0 * yy) + 2.0 * p2 * xy,
    )


def jacobian(x: Numbers, y: Numbers, coefficients: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Derivatives of :func:`distorted`, a symmetric matrix: its entries xx, xy and yy."""
    k1, k2, p1, p2, k3, k4, k5, k6 = coefficients
    r2 = x * x + y * y
    below = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
    radial = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / below
    slope_above = k1 + r2 * (2.0 * k2 + 3.0 * r2 * k3)
    slope_below = k4 + r2 * (2.0 * k5 + 3.0 * r2 * k6)
    growth = 2.0 * (slope_above - radial * slope_below) / below
    return (
        radial + growth * x * x + 2.0 * p1 * y + 6.0 * p2 * x,
        growth * x * y + 2.0 * p1 * x + 2.0 * p2 * y,
        radial + growth * y * y + 6.0 * p1 * y + 2.0 * p2 * x,
    )


def newton_step(
    x: Numbers, y: Numbers, seen_x: Numbers, seen_y: Numbers, coefficients: Numbers
) -> tuple[Numbers, Numbers]:
    """A better guess of the point that appears at (seen_x, seen_y), from the guess (x, y).

    From the start (seen_x, seen_y) the guesses approach from one side, without overshooting, where
    the lens turns ever more inward (barrel) or ever more outward (pincushion).
    """
    at_x, at_y = distorted(x, y, coefficients)
    xx, xy, yy = jacobian(x, y, coefficients)
    off_x, off_y = at_x - seen_x, at_y - seen_y
    determinant = xx * yy - xy * xy
    return (
        x - (yy * off_x - xy * off_y) / determinant,
        y - (xx * off_y - xy * off_x) / determinant,
    )


def undistorted(seen: ArrayLike, distortion: Distortion) -> FloatArray:
    """Points (n, 2) that are seen at places (n, 2) of the picture, both normalised.

    NaN where nothing inside the fold radius is seen.
    """
    places = np.asarray(seen, dtype=np.float64).reshape(-1, 2)
    found = np.empty_like(places)
    for start in range(0, len(places), _BLOCK):
        block = np.ascontiguousarray(places[start : start + _BLOCK].T)
        found[start : start + _BLOCK] = _undistorted(block, distortion)[0].T
    return found


def _undistorted(seen: FloatArray, distortion: Distortion) -> tuple[FloatArray, int]:
    """Points (2, n) and the number of Newton steps that sufficed for all that have one."""
    coefficients = distortion.coefficients
    x, y = seen_x, seen_y = seen
    with np.errstate(all="ignore"):
        rounds, far = 0, True
        while far and rounds < MOST_ROUNDS:
            next_x, next_y = newton_step(x, y, seen_x, seen_y, coefficients)
            far = bool((np.hypot(next_x - x, next_y - y) > _CLOSE).any())
            x, y = next_x, next_y
            rounds += 1
        x, y = newton_step(x, y, seen_x, seen_y, coefficients)
        off = np.hypot(*(np.stack(distorted(x, y, coefficients)) - seen))
        radius = np.hypot(x, y)
        right = (off < 1e-14 * (1.0 + radius)) & (radius < fold_radius(distortion))
    return np.where(right, (x, y), np.nan), rounds + 1


@lru_cache(maxsize=64)
def fold_radius(distortion: Distortion) -> float:
    """Tangent of the angle to the axis up to which each direction has a place of its own."""
    radii = np.tan(np.radians(np.arange(0.0, 89.9, 0.05)))
    angles = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    x, y = (np.multiply.outer(radii, along) for along in (np.cos(angles), np.sin(angles)))
    _, _, _, _, _, k4, k5, k6 = distortion.coefficients
    r2 = x * x + y * y
    with np.errstate(all="ignore"):
        xx, xy, yy = jacobian(x, y, distortion.coefficients)
        # Positive definite: then no two directions of the (convex) disk map to the same point.
        right = (xx * yy - xy * xy > 0.0) & (xx + yy > 0.0)
        right &= 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6)) > 0.0
    turned = np.flatnonzero(~right.all(axis=1))
    return float(radii[turned[0] - 1] if len(turned) else radii[-1])


@lru_cache(maxsize=64)
def newton_steps(
    distortion: Distortion, upper_left: tuple[float, float], lower_right: tuple[float, float]
) -> int | None:
    """Newton steps that suffice to undistort each position of a picture between two corners.

    The corners are normalised. None if a position in the picture sees nothing.

    Only the picture's border is tested: the disk inside the fold radius has no hole, so a disk
    that contains the border contains the whole picture.
    """
    fraction = np.linspace(0.0, 1.0, 65)
    columns, rows = (a + fraction * (b - a) for a, b in zip(upper_left, lower_right, strict=True))
    grid = np.stack(np.meshgrid(columns, rows)).reshape(2, -1)
    found, rounds = _undistorted(grid, distortion)
    return None if np.isnan(found).any() else rounds

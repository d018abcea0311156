"""A feature that was fitted to points: its place, size and form, with their uncertainties."""

from __future__ import annotations

import numpy as np
from attrs import evolve, field, frozen
from attrs.converters import optional

from iriftrace.core.arrays import FloatArray


@frozen(eq=False)
class Feature:
    """A fitted feature. Its numbers are Python's, which JSON has, also where NumPy's are given.

    Attributes
    ----------
    kind : str
    position : (3,) array, mm
        Centre of a sphere or circle; else the point of plane or axis that is nearest to the points'
        centre.
    direction : (3,) array or None
        Unit normal of a plane or circle, unit axis of a line, cylinder or cone; none of a sphere.
        Its largest component is positive, or it has the sense of the near fit that was given; a
        cone's points to its wide end.
    size_mm : float or None, mm
        Diameter (of a cone at `position`); none of plane and line.
    scatter_mm : float or None, mm
        Standard deviation s of a point, s^2 = residuals squared over degrees of freedom, which are
        taken as independent; or that of `with_scatter`. None for a line.
    u_size_mm : float or None, mm
        Standard uncertainty of the diameter: s times the root of its element of (J^T J)^-1.
    half_angle : float or None, rad
        Half opening angle of a cone.
    u_position_mm : float or None, mm
        Standard uncertainty of a plane's `position` along the normal.
    normal_covariance : (3, 3) array or None
        Covariance of a plane's normal.
    residuals : (n,) array, mm
        Signed distances, positive outwards; unsigned for a line or circle.
    """

    kind: str
    position: FloatArray
    direction: FloatArray | None
    size_mm: float | None = field(converter=optional(float))
    u_size_mm: float | None = field(converter=optional(float))
    half_angle: float | None = field(converter=optional(float))
    residuals: FloatArray
    u_position_mm: float | None = field(default=None, converter=optional(float))
    normal_covariance: FloatArray | None = None
    scatter_mm: float | None = field(default=None, converter=optional(float))

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
        radial = np.linalg.norm(arm - np.outer(height, self.direction), axis=1) - radius
        if self.kind == "circle":
            return np.asarray(np.hypot(radial, height))
        angle = self.half_angle or 0.0
        return np.asarray(radial * np.cos(angle) - height * np.sin(angle))

    def with_scatter(self, scatter_mm: float) -> Feature:
        """The same feature of points whose standard deviation is known."""
        if self.scatter_mm is None:
            return self
        ratio = scatter_mm / self.scatter_mm
        covariance = self.normal_covariance
        return evolve(
            self,
            scatter_mm=scatter_mm,
            u_size_mm=None if self.u_size_mm is None else ratio * self.u_size_mm,
            u_position_mm=None if self.u_position_mm is None else ratio * self.u_position_mm,
            normal_covariance=None if covariance is None else ratio**2 * covariance,
        )

    def at(self, place: FloatArray) -> Feature:
        """The same cone with its position, and so its diameter, at the height of a (3,) place."""
        assert self.direction is not None
        assert self.size_mm is not None
        height = float((place - self.position) @ self.direction)
        size = self.size_mm + 2.0 * height * np.tan(self.half_angle or 0.0)
        return evolve(self, position=self.position + height * self.direction, size_mm=size)

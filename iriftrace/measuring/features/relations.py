"""Distances of parallel planes and angles of square ones: steps, widths and squareness."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Literal

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import FloatArray
from iriftrace.core.plain import JsonObject
from iriftrace.measuring.features.feature import Feature
from iriftrace.measuring.features.fitted import FittedFeature
from iriftrace.measuring.features.quantity import Quantity, Unit

NEAR_DEG = 2.0
"""Tolerance within which two planes are parallel or square: forged faces are off by tenths."""

OfPair = Callable[[Feature, Feature], float]


@frozen
class Relation:
    """Distance or angle of two planes.

    Attributes
    ----------
    regions : tuple of two str or None
        Regions of the planes; None for all points.
    value : Quantity
        For parallel planes how far the points' centres are apart along the mean of both normals,
        mm. For square ones the angle, deg, below or above 90 degrees as their normals point (each
        with its largest component positive in the cloud that hot air does not move, and the same
        sense in all others).
    """

    regions: tuple[str | None, str | None]
    value: Quantity

    @property
    def kind(self) -> Literal["distance", "angle"]:
        """Kind of relation."""
        return "angle" if self.value.unit == "deg" else "distance"

    def as_dict(self) -> JsonObject:
        """Plain JSON values."""
        value, key = self.value, self.value.key
        return {
            "kind": self.kind,
            "regions": list(self.regions),
            key: value.by_cloud,
            f"u_{key}": value.u,
            **({"by_member": {key: list(value.by_member)}} if value.by_member else {}),
            **value.statements(),
        }


def relations(features: Sequence[FittedFeature]) -> tuple[Relation, ...]:
    """Distances and angles between the planes among features.

    The first cloud decides which planes are parallel or square.
    """
    planes = [feature for feature in features if feature.kind == "plane"]
    pairs = (_relation(*pair) for pair in combinations(planes, 2))
    return tuple(relation for relation in pairs if relation is not None)


def _relation(one: FittedFeature, other: FittedFeature) -> Relation | None:
    """Relation of two planes; None where they are neither parallel nor square."""
    unit: Unit
    value: OfPair
    doubt: OfPair
    fits = {name: (fit, other.fits[name]) for name, fit in one.fits.items()}
    angle = _angle(*next(iter(fits.values())))
    if min(angle, 180.0 - angle) < NEAR_DEG:
        unit, value, doubt = "mm", _distance, _u_distance
    elif abs(angle - 90.0) < NEAR_DEG:
        unit, value, doubt = "deg", _angle, _u_angle
    else:
        return None
    quantity = Quantity(
        unit,
        {name: value(*pair) for name, pair in fits.items()},
        {name: doubt(*pair) for name, pair in fits.items()},
        tuple(map(value, one.by_member, other.by_member)),
        by_group={
            name: tuple(map(value, fits, other.by_group[name]))
            for name, fits in one.by_group.items()
            if name in other.by_group
        },
    )
    return Relation((one.region, other.region), quantity)


def _normals(one: Feature, other: Feature) -> tuple[FloatArray, FloatArray]:
    return np.asarray(one.direction), np.asarray(other.direction)


def _angle(one: Feature, other: Feature) -> float:
    """Angle between the normals, deg, exact for small ones."""
    first, second = _normals(one, other)
    across = np.linalg.norm(np.cross(first, second))
    return float(np.degrees(np.arctan2(across, first @ second)))


def _distance(one: Feature, other: Feature) -> float:
    """Length of the arm between the centres along the mean of two normals, of either sense."""
    first, second = _normals(one, other)
    mean = first + np.copysign(1.0, first @ second) * second
    return float(abs((other.position - one.position) @ mean) / np.linalg.norm(mean))


def _u_distance(one: Feature, other: Feature) -> float:
    """By the heights of both centres, and by the tilt of the mean normal over the arm."""
    arm = other.position - one.position
    heights = np.array([one.u_position_mm, other.u_position_mm], dtype=np.float64)
    tilts = np.asarray(one.normal_covariance) + np.asarray(other.normal_covariance)
    return float(np.sqrt(np.square(heights).sum() + arm @ tilts @ arm / 4.0))


def _u_angle(one: Feature, other: Feature) -> float:
    """By the tilt of each normal towards the other, deg."""
    first, second = _normals(one, other)
    tilts = np.asarray(one.normal_covariance), np.asarray(other.normal_covariance)
    variance = second @ tilts[0] @ second + first @ tilts[1] @ first
    return float(np.degrees(np.sqrt(variance) / np.linalg.norm(np.cross(first, second))))

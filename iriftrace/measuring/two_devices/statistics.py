"""Outcomes of points, errors of members along normals, and values by region of a part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import AnyIntArray, BoolArray, FloatArray
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.statistics import spread
from iriftrace.measuring.features.quantity import WorstMember
from iriftrace.part.part import Part
from iriftrace.tracing.hot_air import FieldMember


class PointStatus(IntEnum):
    """Outcome of a point, which scans and corrections define."""

    @property
    def key(self) -> str:
        """Name in JSON."""
        return self.name.lower()

    @classmethod
    def counts(cls, status: AnyIntArray) -> dict[str, int]:
        """How many points have each status, by key."""
        return {one.key: int((status == one).sum()) for one in cls}


def each_along(errors: FloatArray, normal: FloatArray) -> FloatArray:
    """Components (k, n), mm, of (k, n, 3) errors of k members along (n, 3) normals."""
    along: FloatArray = np.einsum("kij,ij->ki", errors, normal)
    return along


def completed(
    found: Mapping[int, tuple[FloatArray, BoolArray]],
    members: Sequence[FieldMember],
    weights: MemberWeights,
) -> FloatArray:
    """Errors (k, n, 3) of all members from those (n, 3) of some, and where (n,) they are known.

    Elsewhere a variation has the error of the field that it varies, as of an input without effect,
    and any other member without weight the mean's.
    """
    points = len(next(iter(found.values()))[1])
    errors, known = np.zeros((len(members), points, 3)), np.zeros((len(members), points, 1), bool)
    for place, (error, there) in found.items():
        errors[place], known[place] = error, there[:, None]
    whole = np.where(known, errors, weights.mean(errors))
    places = {member.source.sha256: place for place, member in enumerate(members)}
    for place, member in enumerate(members):
        if member.variation is not None:
            base = places[member.variation.of]
            whole[place] = np.where(known[place] & known[base], errors[place], whole[base])
    return whole


def worst_member(
    values: FloatArray, true: float, weights: MemberWeights, numbers: Sequence[int]
) -> WorstMember:
    """The member in the mean whose value of the (k,) is farthest from the true one."""
    worst = int(np.argmax(np.abs(values - true) * (weights.weights > 0.0)))
    return WorstMember(numbers[worst], float(values[worst]))


@frozen
class RegionValues:
    """Measured points of a region and their values along the normal; no values without a point."""

    region: str
    points: int
    # Area of the faces with a point as a fraction of the region's; None for one line of a laser.
    measured: float | None
    along_normal_mm: dict[str, float] | None  # `spread` of the values
    size_p95_mm: float | None  # 95th percentile of their sizes


def region_values(
    part: Part, face: AnyIntArray, along_normal: FloatArray, *, one_line: bool = False
) -> tuple[RegionValues, ...]:
    """Values (n,), mm, of points on the faces (n,) of a part by its regions, in their order."""
    hit = np.zeros(len(part.faces))
    hit[face] = part.face_areas[face]
    areas = np.bincount(part.region_of_face, hit, minlength=len(part.region_names))
    region = part.region_of_face[face]
    found = []
    for number, name in enumerate(part.region_names):
        values = along_normal[region == number]
        measured = None if one_line else float(areas[number] / part.region_areas[number])
        statistics = spread(values) if len(values) else None
        p95 = float(np.percentile(np.abs(values), 95)) if len(values) else None
        found.append(RegionValues(name, len(values), measured, statistics, p95))
    return tuple(found)

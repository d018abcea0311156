"""Outcomes of points, and errors of members along normals."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from iriftrace.core.arrays import FloatArray
from iriftrace.core.plain import JsonObject


class PointStatus(IntEnum):
    """Outcome of a point, which scans and corrections define."""

    @property
    def key(self) -> str:
        """Name in JSON."""
        return self.name.lower()

    @classmethod
    def counts(cls, status: NDArray[np.int64]) -> dict[str, int]:
        """How many points have each status, by key."""
        return {one.key: int((status == one).sum()) for one in cls}


def each_along(errors: FloatArray, normal: FloatArray) -> FloatArray:
    """Components (k, n), mm, of (k, n, 3) errors of k members along (n, 3) normals."""
    along: FloatArray = np.einsum("kij,ij->ki", errors, normal)
    return along


def worst_member(values: list[float], true: float, key: str, provenance: JsonObject) -> JsonObject:
    """Number of the member whose value is farthest from the true one, and that value.

    As ``worst_member`` and ``worst_`` and the key of the values, such as ``size_mm``.
    """
    worst = int(np.argmax(np.abs(np.array(values) - true)))
    number = provenance["ensemble"]["members"][worst]["number"]
    return {"worst_member": number, f"worst_{key}": values[worst]}

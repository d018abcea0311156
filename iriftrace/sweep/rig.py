"""Two devices that move together: their measurements from each pose of a sweep."""

from __future__ import annotations

import numpy as np
from attrs import frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError, without_warnings
from iriftrace.core.plain import JsonObject
from iriftrace.core.statistics import spread
from iriftrace.measuring.features.choice import found_features
from iriftrace.measuring.two_devices.measure import measure
from iriftrace.measuring.two_devices.scan import Scan, ScanStatus
from iriftrace.part.part import Part
from iriftrace.tracing.rays import is_inside
from iriftrace.tracing.scene import Scene

FEWEST_POINTS = 100
"""Minimum number of points of a region for a statement about it; as for rays of a picture."""


@frozen(eq=False)
class Rig:
    """The second device of a rigid sensor."""

    device: Camera  # its own pose is not used
    to_first: FloatArray  # (4, 4), mm, rigid motion from its frame to the first device's

    def placed(self, matrix: FloatArray) -> Camera:
        """The second device where the first one is at ``matrix`` (4, 4), mm, camera to world."""
        return self.device.at(matrix @ self.to_first)

    def as_dict(self, device: str) -> JsonObject:
        """Plain JSON values for a sweep; `device` is the id of the second one in the scene."""
        return {"device": device, "to_first": self.to_first.tolist()}

    def same_as(self, other: Rig | None) -> bool:
        """True if another rig measures the same from the same poses."""
        if other is None:
            return False
        devices = [{**one.device.as_dict(), "matrix": None} for one in (self, other)]
        return devices[0] == devices[1] and np.allclose(self.to_first, other.to_first, atol=1e-9)


def rig_of(scene: Scene) -> Rig | None:
    """The rigid sensor of a scene's two devices; None for a scene with one camera."""
    if scene.second is None:
        return None
    return Rig(scene.second, np.linalg.inv(scene.camera.matrix) @ scene.second.matrix)


def add_measured(metrics: JsonObject, scene: Scene, camera: Camera, second: Camera) -> None:
    """Add the measurement of two devices to a pose's metrics (plain values).

    The key ``scan`` for the whole part and for each region: ``points``, ``coverage`` (area that
    both see over the area), ``error_normal_mm`` (mean, median, p95 and rms of the size of
    the error along the normal, and the median with its sign, ``bias``) and for an ensemble
    ``scatter_normal_mm``, nothing for fewer than `FEWEST_POINTS`; ``size_mm``, the error of the
    region's diameter if it is a cylinder or sphere, for the whole part the largest one, and for an
    ensemble its ``size_scatter_mm``. The whole part also has ``lost``, points whose rays are lost.
    It is not an error if nothing can be measured.
    """
    found = _measured_by(scene, camera, second)
    metrics["scan"] = found.pop("part")
    for name, region in metrics["regions"].items():
        region["scan"] = found.get(name)


def _measured_by(scene: Scene, camera: Camera, second: Camera) -> JsonObject:
    part = scene.part
    if is_inside(scene, second.matrix[None, :3, 3]).any():
        return _nothing(part)
    try:
        with without_warnings():
            # The sweep's flags state it for all poses.
            scan = measure(scene, camera, second)
            sizes = _size_errors(scan, part)
    except InputError:
        return _nothing(part)
    everything = np.ones(len(part.faces), dtype=bool)
    seen = part.face_areas * scan.seen_fractions(part)
    largest = max(sizes.values(), key=lambda size: abs(size.error_mm), default=None)
    return {
        "part": {
            **_of(scan, part, everything, seen, largest),
            "lost": int((scan.status == ScanStatus.LOST).sum()),
        },
        **{
            name: _of(scan, part, part.region_of_face == number, seen, sizes.get(name))
            for number, name in enumerate(part.region_names)
        },
    }


def _nothing(part: Part) -> JsonObject:
    return {name: {"points": 0, "coverage": 0.0} for name in ("part", *part.region_names)}


def _of(
    scan: Scan, part: Part, faces: BoolArray, seen: FloatArray, size: _Size | None
) -> JsonObject:
    """Values of some faces (m,), of which the devices see areas (m,), mm^2."""
    chosen = faces[scan.face]
    known: JsonObject = {
        "points": int(chosen.sum()),
        "coverage": float(seen[faces].sum() / part.face_areas[faces].sum()),
    }
    if chosen.sum() < FEWEST_POINTS:
        return known
    errors, scatter = scan.error_normal[chosen], scan.scatter_normal
    return known | {
        "size_mm": None if size is None else size.error_mm,
        "size_scatter_mm": None if size is None else size.scatter_mm,
        "error_normal_mm": {
            **spread(np.abs(errors), ("mean", "median", "p95", "rms")),
            "bias": float(np.median(errors)),
        },
        **({} if scatter is None else {"scatter_normal_mm": spread(scatter[chosen])}),
    }


@frozen
class _Size:
    """Error of a diameter, and its standard deviation over an ensemble's members, mm."""

    error_mm: float
    scatter_mm: float | None


def _size_errors(scan: Scan, part: Part) -> dict[str, _Size]:
    """Errors of diameters by region."""
    choices = [each for each in found_features(part, scan.face) if each.kind != "plane"]
    found = {}
    for feature in scan.features(part, choices, None) if choices else ():
        error = feature.size.difference("measured", "cold")
        if feature.region is not None and error is not None:
            found[feature.region] = _Size(error, feature.size.scatter)
    return found

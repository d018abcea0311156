"""The AOV image of one pose: of one field, or of the mean of several with their scatter."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import TYPE_CHECKING

import numpy as np
from attrs import evolve

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import AnyArray, Float32Array
from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject
from iriftrace.core.runtime import variant as runtime
from iriftrace.image.aov_image import (
    CHANNELS,
    ERROR_CHANNEL,
    MEMBERS_CHANNEL,
    SCHEMA,
    WORST_CHANNEL,
    WORST_NORM_CHANNEL,
    AovImage,
    Status,
)
from iriftrace.image.displacement import good_mask
from iriftrace.tracing.provenance import provenance
from iriftrace.tracing.scene import Scene

if TYPE_CHECKING:
    import mitsuba as mi

    from iriftrace.plugins.kernels.bundle import StraightHits

_SCATTERED = (*(f"displacement.{axis}" for axis in "XYZ"), "shift.px.X", "shift.px.Y")
_AVERAGED = (*_SCATTERED, "path.length", "path.crossings")


def pose_image(
    scene: Scene,
    camera: Camera | None = None,
    include: Collection[int] = (0,),
    straight: StraightHits | None = None,
    each: Callable[[int, AovImage], None] | None = None,
) -> AovImage:
    """Trace straight and refracted rays of a scene's own sensor, or of a camera instead of it.

    All members of an ensemble are traced, one after the other, and passed to `each` with their
    place, from 0. Those without weight, which vary another one, are traced for `each` alone.
    Straight rays are traced once, or not at all if their hits are given. Rays with a code in
    `include` enter its mean and scatter.
    A camera in the hot air or in the part is refused, and so is a film that would smear the
    channels.
    """
    if not scene.members:
        image, _ = _one_field(scene, camera, straight)
        if each is not None:
            each(0, image)
        return evolve(image, header=_with_origin(image.header, scene))
    statistics = EnsembleStatistics(include)
    time_s: dict[str, float] = {}
    counts: dict[str, int] = {}
    places = [n for n, one in enumerate(scene.members) if one.weight or each is not None]
    for place, member in zip(places, scene.alone(places), strict=True):
        listed = scene.members[place]
        image, straight = _one_field(member, camera, straight, f" of member {listed.number}")
        if each is not None:
            each(place, image)
        if not listed.weight:
            continue
        kept, last = image, image.header
        if scene.averages:
            statistics.add(image, listed.weight, listed.number)
        for key, seconds in last["time_s"].items():
            time_s[key] = time_s.get(key, 0.0) + seconds
        for key, count in last["counts"].items():
            counts[key] = max(counts.get(key, 0), count)
    header = _with_origin({**last, "time_s": time_s, "counts": counts}, scene)
    return statistics.image(header) if scene.averages else evolve(kept, header=header)


def _with_origin(header: JsonObject, scene: Scene) -> JsonObject:
    """The header of an image, with schema and provenance."""
    return {"schema": SCHEMA, **provenance(scene, Camera.from_dict(header["camera"])), **header}


def sensor_for(scene: Scene, camera: Camera | None) -> mi.Sensor:
    """Mitsuba's sensor of a camera, or the scene's own; the scene's variant is set."""
    from iriftrace.plugins.calibrated_camera import sensor_of

    own = scene.compiled.mitsuba_scene.sensors()[0]
    sensor: mi.Sensor = own if camera is None else sensor_of(camera)
    return sensor


def _one_field(
    scene: Scene, camera: Camera | None, straight: StraightHits | None, whose: str = ""
) -> tuple[AovImage, StraightHits]:
    """The image of one field without provenance, and its straight hits, which others use, too."""
    compiled, integrator = scene.compiled, scene.compiled.integrator
    with runtime.using(compiled.variant):
        sensor = sensor_for(scene, camera)
        where = integrator.surroundings(compiled.mitsuba_scene, sensor)
        if where is not None:
            raise InputError(
                f"The camera stands inside the {where}{whose if where == 'hot air' else ''}, where "
                "its picture means nothing; move it farther away.",
                code="camera.inside",
            )
        tensor, report = integrator.image(compiled.mitsuba_scene, sensor, straight)
        # A view of Dr.Jit's memory where that is the processor's own.
        planes = tensor.numpy()
        # Objects are in the way only where the part is behind them.
        bystanders = integrator.bystanders(compiled.mitsuba_scene, sensor, report["straight"])
    seen_by, times = report["camera"], report["time_s"]
    header = {
        "camera": seen_by,
        "pose": {
            "origin_mm": [row[3] for row in seen_by["matrix"][:3]],
            "matrix": seen_by["matrix"],
        },
        "time_s": {
            "load": compiled.load_s,
            "build": compiled.build_s,
            "straight": times["straight"],
            "refracted": times["refracted"],
        },
        "counts": report["counts"],
        # Before ``scale`` changed it, px.
        "full_resolution": list(compiled.unscaled(camera or compiled.camera)),
    }
    channels = dict(zip(integrator.aov_names(), planes, strict=True))
    if len(bystanders):
        status = channels["status.code"] = channels["status.code"].copy()
        bent_hits = channels["path.length"].ravel()[bystanders] > 0.0
        status.ravel()[bystanders] = np.where(bent_hits, Status.ONLY_REFRACTED, Status.MISSED)
    return AovImage(channels, header), report["straight"]


class EnsembleStatistics:
    """Running weighted mean and variance of every pixel, and its worst member.

    Welford, Technometrics 4 (1962) 419; West, Communications of the ACM 22 (1979) 532. Memory does
    not grow with the number of members: for each pixel on the part 7 means and 5 variances. Only
    rays that count enter, so the number of members differs between pixels near silhouettes; the
    channel ``ensemble.members`` holds it. Rays count by their status codes.
    """

    def __init__(self, include: Collection[int] = (Status.GOOD,)) -> None:
        self.count = 0
        self._include = tuple(include)

    def add(self, image: AovImage, weight: float = 1.0, number: int | None = None) -> None:
        """Add the image of one more member, of the same part and camera.

        By default `number` counts the images, from 1.
        """
        face = image.channels["part.face"].ravel()
        if self.count == 0:
            self._begin(image, face)
        elif not np.array_equal(face[self._pixels], self._face):
            raise InputError(
                "The members of the ensemble show different parts or cameras, so their pixels "
                "cannot be compared; write the ensemble's scene again.",
                code="scene.members_differ",
            )
        self.count += 1
        good = good_mask(image, self._include).ravel()[self._pixels]
        self._members += good
        status = image.channels["status.code"].ravel()[self._pixels]
        first = (self._status == Status.GOOD) & (status != Status.GOOD)
        self._status[first] = status[first]
        own = weight * good
        self._weight += own
        self._weight_squared += own * weight
        fraction = np.divide(own, self._weight, out=np.zeros(len(good)), where=self._weight > 0)
        for name, mean in self._mean.items():
            value = image.channels[name].ravel()[self._pixels].astype(np.float64)
            step = (value - mean) * fraction
            if name in self._square:
                self._square[name] += own * (value - mean) * (value - mean - step)
            mean += step
        norm = image.channels["displacement.norm"].ravel()[self._pixels]
        worse = good & ((norm > self._worst_norm) | (self._worst == 0))
        self._worst[worse] = self.count if number is None else number
        self._worst_norm[worse] = norm[worse]
        if self._error is not None:
            error = image.channels[ERROR_CHANNEL].ravel()[self._pixels]
            np.maximum(self._error, np.where(good, error, 0.0), out=self._error)

    def image(self, header: JsonObject) -> AovImage:
        """The image of the means, with the channels of the scatter.

        ``displacement``, ``shift.px`` and ``refracted`` are those of the mean over the members
        whose ray counts; ``displacement.norm`` is the length of the mean vector. The standard
        deviations are those of a weighted sample, as `MemberWeights.scatter`;
        ``displacement.std.norm`` is the root of the sum of the variances along the axes. A pixel
        is good if it is good in every member; else its status is that of the first member where it
        is not.
        """
        channels = {name: self._first.channels[name].copy() for name in CHANNELS}
        some = self._weight > 0

        def put(name: str, values: AnyArray) -> None:
            plane = channels.setdefault(name, np.zeros(self._shape, dtype=np.float32))
            plane.ravel()[self._pixels] = values

        for name, mean in self._mean.items():
            put(name, np.where(some, mean, 0.0))
        vector = np.stack([self._mean[f"displacement.{axis}"] for axis in "XYZ"])
        put("displacement.norm", np.where(some, np.linalg.norm(vector, axis=0), 0.0))
        for axis, moved in zip("XYZ", vector, strict=True):
            straight = channels[f"straight.{axis}"].ravel()[self._pixels]
            put(f"refracted.{axis}", np.where(some, straight + moved, 0.0))
        total = np.where(some, self._weight, 1.0)
        freedom = total - self._weight_squared / total
        several = some & (freedom > 1e-9 * total)
        variance = {
            name: np.divide(square, freedom, out=np.zeros(len(square)), where=several)
            for name, square in self._square.items()
        }
        for name, values in variance.items():
            quantity, axis = name.rsplit(".", 1)
            put(f"{quantity}.std.{axis}", np.sqrt(values))
        put("displacement.std.norm", np.sqrt(sum(variance[f"displacement.{a}"] for a in "XYZ")))
        put("status.code", self._status)
        put(MEMBERS_CHANNEL, self._members)
        put(WORST_CHANNEL, self._worst)
        put(WORST_NORM_CHANNEL, self._worst_norm)
        if self._error is not None:
            put(ERROR_CHANNEL, self._error)
        return AovImage(channels, header)

    def _begin(self, image: AovImage, face: Float32Array) -> None:
        self._first = image
        self._shape = image.channels["part.face"].shape
        self._pixels = np.flatnonzero(face > 0)
        self._face = face[self._pixels]
        count = len(self._pixels)
        self._members, self._worst = np.zeros((2, count), dtype=np.int64)
        self._weight, self._weight_squared = np.zeros((2, count))
        self._worst_norm = np.zeros(count, dtype=np.float32)
        self._status = np.full(count, float(Status.GOOD), dtype=np.float32)
        self._mean = {name: np.zeros(count) for name in _AVERAGED}
        self._square = {name: np.zeros(count) for name in _SCATTERED}
        self._error = np.zeros(count, np.float32) if ERROR_CHANNEL in image.channels else None

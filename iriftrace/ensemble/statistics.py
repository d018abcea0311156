"""Mean and standard deviation of the members' images, one image in memory at a time."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from iriftrace.channels import CHANNELS, ERROR_CHANNEL, MEMBERS_CHANNEL
from iriftrace.displacement import good_mask
from iriftrace.errors import InputError
from iriftrace.exr import AovImage
from iriftrace.status import Status

FloatArray = NDArray[np.float64]

_SCATTERED = (*(f"displacement.{axis}" for axis in "XYZ"), "shift.px.X", "shift.px.Y")
_AVERAGED = (*_SCATTERED, "path.length", "path.crossings")


class EnsembleStatistics:
    """Running mean and variance of every pixel (Welford, Technometrics 4 (1962) 419).

    Memory does not grow with the number of members: for each pixel on the part 7 means and 5
    variances. Only rays that count enter, so the number of members differs between pixels near
    silhouettes; the channel ``ensemble.members`` holds it.

    Parameters
    ----------
    include : collection of int
        Status codes of the rays that count.
    """

    def __init__(self, include: Collection[int] = (Status.GOOD,)) -> None:
        self.count = 0
        self._include = tuple(include)

    def add(self, image: AovImage) -> None:
        """Take in the image of one more member, of the same part and camera.

        Raises
        ------
        InputError
            Its straight rays hit other faces than those of the members before.
        """
        face = image.channels["part.face"].ravel()
        if self.count == 0:
            self._begin(image, face)
        elif not np.array_equal(face[self._pixels], self._face):
            raise InputError(
                "The members of the ensemble show different parts or cameras, so their pixels "
                "cannot be compared; write the ensemble's scene again."
            )
        self.count += 1
        good = good_mask(image, self._include).ravel()[self._pixels]
        self._members += good
        status = image.channels["status.code"].ravel()[self._pixels]
        first = (self._status == Status.GOOD) & (status != Status.GOOD)
        self._status[first] = status[first]
        weight = np.divide(good, self._members, out=np.zeros(len(good)), where=self._members > 0)
        for name, mean in self._mean.items():
            value = image.channels[name].ravel()[self._pixels].astype(np.float64)
            step = (value - mean) * weight
            if name in self._square:
                self._square[name] += good * (value - mean) * (value - mean - step)
            mean += step
        if self._error is not None:
            error = image.channels[ERROR_CHANNEL].ravel()[self._pixels]
            np.maximum(self._error, np.where(good, error, 0.0), out=self._error)

    def image(self, header: dict[str, Any]) -> AovImage:
        """The image of the means, with the channels of the scatter.

        ``displacement``, ``shift.px`` and ``refracted`` are those of the mean over the members
        whose ray counts; ``displacement.norm`` is the length of the mean vector. The standard
        deviations are those of a sample (n - 1); ``displacement.std.norm`` is the root of the sum
        of the variances along the axes. A pixel is good if it is good in every member; else its
        status is that of the first member where it is not.
        """
        channels = {name: self._first.channels[name].copy() for name in CHANNELS}
        some, several = self._members > 0, self._members > 1

        def put(name: str, values: NDArray[Any]) -> None:
            plane = channels.setdefault(name, np.zeros(self._shape, dtype=np.float32))
            plane.ravel()[self._pixels] = values

        for name, mean in self._mean.items():
            put(name, np.where(some, mean, 0.0))
        vector = np.stack([self._mean[f"displacement.{axis}"] for axis in "XYZ"])
        put("displacement.norm", np.where(some, np.linalg.norm(vector, axis=0), 0.0))
        for axis, moved in zip("XYZ", vector, strict=True):
            straight = channels[f"straight.{axis}"].ravel()[self._pixels]
            put(f"refracted.{axis}", np.where(some, straight + moved, 0.0))
        degrees = np.maximum(self._members - 1, 1)
        variance = {
            name: np.where(several, square / degrees, 0.0) for name, square in self._square.items()
        }
        for name, values in variance.items():
            quantity, axis = name.rsplit(".", 1)
            put(f"{quantity}.std.{axis}", np.sqrt(values))
        put("displacement.std.norm", np.sqrt(sum(variance[f"displacement.{a}"] for a in "XYZ")))
        put("status.code", self._status)
        put(MEMBERS_CHANNEL, self._members)
        if self._error is not None:
            put(ERROR_CHANNEL, self._error)
        return AovImage(channels, header)

    def _begin(self, image: AovImage, face: NDArray[np.float32]) -> None:
        self._first = image
        self._shape = image.channels["part.face"].shape
        self._pixels = np.flatnonzero(face > 0)
        self._face = face[self._pixels]
        count = len(self._pixels)
        self._members = np.zeros(count, dtype=np.int64)
        self._status = np.full(count, float(Status.GOOD), dtype=np.float32)
        self._mean = {name: np.zeros(count) for name in _AVERAGED}
        self._square = {name: np.zeros(count) for name in _SCATTERED}
        self._error = np.zeros(count, np.float32) if ERROR_CHANNEL in image.channels else None

"""Measured pixel shifts against those of a rendering: how far apart, and why.

A camera that moves a little between the cold and the hot picture shifts all of the picture, often
by more than the air does. So the residual is split into the part that a rigid motion of the camera
explains, and the rest.
"""

from __future__ import annotations

from collections.abc import Collection
from importlib.metadata import version
from pathlib import Path

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import write_json
from iriftrace.core.plain import JsonObject, plain
from iriftrace.core.statistics import rms, spread
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.image.displacement import shift_map
from iriftrace.io.measured_shift import MeasuredShift
from iriftrace.measuring.camera_motion import FEWEST_POINTS, CameraMotion, fit_camera_motion
from iriftrace.measuring.fit.shift_signs import warn_of_signs
from iriftrace.measuring.map_size import refuse_other_size
from iriftrace.measuring.options import COLD, Picture

SCHEMA = "iriftrace.comparison/2"
CONVENTION = (
    "shift: position in the hot picture minus position in the cold one, px, u right, v down; in "
    "files (0, 0) is the centre of the first pixel; residual: measured minus simulated; camera "
    "motion: from cold to hot, in the camera's frame (x right, y down, z forward)"
)


@frozen(eq=False)
class Comparison:
    """Measured and simulated shifts at the n places that have both.

    Attributes
    ----------
    places : (n, 2) array, px
        Where the shifts were measured.
    measured, simulated : (n, 2) arrays, px
    points : (n, 3) array, mm, world
        Points seen there.
    image : AovImage
        The rendering.
    measurement : MeasuredShift
        All measured shifts, also at places without a simulated shift: outside the part, or where
        the ray does not count.
    positions : str
        The picture in which the places were measured, ``"cold"`` or ``"hot"``.
    motion : CameraMotion or None
        Motion that explains the residual best.
    no_motion : str
        Why there is no motion; empty if there is one.
    """

    places: FloatArray
    measured: FloatArray
    simulated: FloatArray
    points: FloatArray
    image: AovImage
    measurement: MeasuredShift
    positions: Picture
    motion: CameraMotion | None
    no_motion: str

    @property
    def residual(self) -> FloatArray:
        """(n, 2) array, px: measured minus simulated."""
        return self.measured - self.simulated

    @property
    def remainder(self) -> FloatArray:
        """(n, 2) array, px: the residual without the camera's motion."""
        return self.residual if self.motion is None else self.residual - self.motion.shifts

    def as_dict(self) -> JsonObject:
        """All numbers, as plain JSON values."""
        residual, measured = self.residual, self.measurement
        copied = ("camera", "pose", "wavelength_nm", "field", "part", "engine", "assumptions")
        return {
            "schema": SCHEMA,
            "version": version("iriftrace"),
            "image": plain(self.image.origin),
            "measured": {
                "path": str(Path(measured.origin.path).resolve()),
                "sha256": measured.origin.sha256,
                "kind": "markers" if measured.resolution is None else "map",
                "positions": self.positions,
            },
            "convention": CONVENTION,
            "points": {
                "measured": len(measured.places),
                "failed": measured.failed,
                "zeros": measured.zeros,
                "compared": len(residual),
                "without_simulation": len(measured.places) - len(residual),
            },
            "measured_px": _lengths(self.measured),
            "simulated_px": _lengths(self.simulated),
            "residual_px": {"bias": residual.mean(axis=0).tolist(), **_lengths(residual)},
            "correlation": correlation(self.measured, self.simulated),
            "camera_motion": _motion(self),
            **{key: self.image.header.get(key) for key in copied},
        }

    def save(self, path: str | Path) -> None:
        """Write the numbers as JSON, completely or not at all."""
        write_json(path, self.as_dict())


def compare(
    image: AovImage,
    measured: MeasuredShift,
    *,
    positions: Picture = COLD,
    include: Collection[int] = (Status.GOOD,),
) -> Comparison:
    """Compare measured shifts with the channel ``shift.px`` of a rendering.

    Parameters
    ----------
    image : AovImage
        The rendering, at the camera's own resolution.
    measured : MeasuredShift
    positions : str
        The picture in which the places were measured: ``"cold"``, as in most correlation programs,
        where the first picture is the reference, or ``"hot"``. Simulated shifts belong to the hot
        picture, so each is looked up where the place of the cold picture is seen when hot.
    include : collection of int
        Status codes of the rays that count.

    Raises
    ------
    InputError
        A map has another size than the rendering, a marker lies outside it, or too few places have
        a simulated shift.

    Warns
    -----
    IriftraceWarning
        Markers may be positions in a picture of the camera's full resolution, which differs from
        that of the rendering; or shifts of another sign match far better.
    """
    image.require("camera")
    _refuse_another_picture(image, measured)
    shift, points, known = _at_places(image, measured.places, positions, include)
    if known.sum() < FEWEST_POINTS:
        width, height = image.resolution
        raise InputError(
            f"Only {known.sum()} of {len(known)} measured places lie on good pixels of the part in "
            f"the rendering of {width} x {height} pixels, but {FEWEST_POINTS} are needed; check "
            "that the positions are in its pixels and that its pose is that of the measurement.",
            code="shifts.too_few",
        )
    _warn_of_another_size(image, measured)
    warn_of_signs(
        lambda signs: _without_mean(signs * measured.shifts[known] - shift[known]),
        measured.origin.path,
    )
    residual = measured.shifts[known] - shift[known]
    motion, reason = None, ""
    try:
        motion = fit_camera_motion(image.camera, points[known], residual)
    except InputError as error:
        reason = str(error)
    return Comparison(
        places=measured.places[known],
        measured=measured.shifts[known],
        simulated=shift[known],
        points=points[known],
        image=image,
        measurement=measured,
        positions=positions,
        motion=motion,
        no_motion=reason,
    )


def _without_mean(shifts: FloatArray) -> float:
    """Root mean square of a component, px, without what a turn of the camera adds everywhere."""
    return rms((shifts - shifts.mean(axis=0)).ravel())


def _refuse_another_picture(image: AovImage, measured: MeasuredShift) -> None:
    """Refuse a map of another size than the rendering, and markers outside it."""
    remedy = "render at the camera's resolution (scale=1)"
    refuse_other_size(measured, image.resolution, "the rendering", remedy)
    outside = ~image.camera.holds(measured.places)
    if outside.any():
        u, v = measured.places[outside][0]
        width, height = image.resolution
        raise InputError(
            f"{outside.sum()} of {len(outside)} places of {measured.origin.path} lie outside the "
            f"rendering of {width} x {height} pixels, the first at ({u:g}, {v:g}), so they are "
            f"positions in another picture; {remedy}.",
            code="shifts.outside_picture",
        )


def _warn_of_another_size(image: AovImage, measured: MeasuredShift) -> None:
    """Warn of markers whose picture may be larger; only a map states the size of its picture."""
    full = image.header.get("full_resolution")
    if measured.resolution is not None or full is None or tuple(full) == image.resolution:
        return
    (width, height), (across, down) = image.resolution, full
    warn(
        f"The rendering has {width} x {height} px, {width / across:.3g} times the camera's "
        f"{across} across and {height / down:.3g} times its {down} down; the measured positions "
        "must be in the rendering's pixels, or render the whole picture (scale=1)."
    )


def _at_places(
    image: AovImage, places: FloatArray, positions: Picture, include: Collection[int]
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Simulated shifts (n, 2) and refracted hits (n, 3) for places, and where they are known."""
    shift = shift_map(image, include)
    values = np.concatenate((shift.pixels, image.vector("refracted")), axis=2)
    found, known = _interpolated(values, shift.good, places)
    if positions == "cold":
        # Twice: shifts change slowly, so that the second change is far below measured differences.
        for _ in range(2):
            found, known = _interpolated(values, shift.good, places + found[:, :2])
    return found[:, :2], found[:, 2:], known


def _interpolated(
    values: FloatArray, good: BoolArray, places: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Linear between pixel centres; known where all pixels that contribute are good."""
    height, width = good.shape
    across, down = places.T
    column, row = np.floor(across), np.floor(down)
    total = np.zeros((len(places), values.shape[2]))
    known = np.ones(len(places), dtype=np.bool_)
    for dy in (0, 1):
        for dx in (0, 1):
            weight = np.abs(1 - dx - (across - column)) * np.abs(1 - dy - (down - row))
            i, j = row + dy, column + dx
            counts = weight > 1e-9
            inside = (i >= 0) & (i < height) & (j >= 0) & (j < width)
            pixel = np.where(inside, i, 0).astype(int), np.where(inside, j, 0).astype(int)
            usable = inside & good[pixel]
            known &= usable | ~counts
            total += np.where(usable & counts, weight, 0.0)[:, None] * values[pixel]
    return np.where(known[:, None], total, 0.0), known


def _lengths(vectors: FloatArray) -> dict[str, float]:
    return spread(np.linalg.norm(vectors, axis=1), ("rms", "median", "p95", "max"))


def correlation(one: FloatArray, other: FloatArray) -> float | None:
    """Pearson's coefficient of both components together; None if one of the fields is constant."""
    a, b = ((field - field.mean(axis=0)).ravel() for field in (one, other))
    scale = float(np.linalg.norm(a) * np.linalg.norm(b))
    return float(a @ b) / scale if scale > 0 else None


def _motion(comparison: Comparison) -> JsonObject:
    motion = comparison.motion
    if motion is None:
        return {"reason": comparison.no_motion}
    cleaned = comparison.measured - motion.shifts
    used = motion.used
    return {
        "translation_um": (1e3 * motion.translation_mm).tolist(),
        "translation_std_um": (1e3 * motion.deviations[:3]).tolist(),
        "rotation_urad": (1e6 * motion.rotation_rad).tolist(),
        "rotation_std_urad": (1e6 * motion.deviations[3:]).tolist(),
        "uncertainty": "one standard deviation, as if residuals were independent of each other",
        "points": int(used.sum()),
        "outliers": int((~used).sum()),
        "rms_before_px": motion.rms_before_px,
        "rms_after_px": motion.rms_after_px,
        "explained": motion.explained,
        "correlation_after": correlation(cleaned[used], comparison.simulated[used]),
    }

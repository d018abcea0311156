"""A measured cloud without the air's share.

A sensor found X' where the straight lines of its devices meet; the bent ones end on X. The error
e(X) = X' - X of a point is known by `lines_of_sight`, so X is the fixed point of X <- X' - e(X).
Both are found together: each round traces both devices' lines once, aims them anew and moves the
point. A round shrinks what is left as one of `lines_of_sight` does.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from attrs import field, frozen
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from iriftrace.camera.camera import Camera
from iriftrace.camera.tiles import places_in_tiles
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.statistics import spread
from iriftrace.geometry.triangles import unit_vectors
from iriftrace.part.part import Part
from iriftrace.scene.load import LoadedScene
from iriftrace.scene.scene import AnyScene
from iriftrace.trace.engine import choose_for_devices
from iriftrace.trace.lost import warn_of_lost_points
from iriftrace.triangulation.cloud import PointStatus, by_axis, save_cloud, scatter_along
from iriftrace.triangulation.features import GATE, feature_table
from iriftrace.triangulation.field_state import FieldState, field_state
from iriftrace.triangulation.scan import (
    Phase,
    System,
    devices_of,
    provenance_of_two,
    triangulated,
)
from iriftrace.triangulation.two_points import lines_of_sight

SCHEMA = "iriftrace.correction/1"

REACH_MM = 1.0
"""Farthest distance from the part of a point that is still one of it.

Forged parts are off their CAD model by some tenths of a millimetre.
"""

SETTLED_MM = 1e-5
"""A round that moves point and aims by less is the last: a hundredth of what sensors resolve."""

ROUNDS = 20
"""Straight down a plume a round leaves a third; from a millimetre twelve leave a nanometre."""

SAMPLE = 10_000
"""Points whose distance from the part is asked for."""

MANY = 0.05
"""Share of points, hidden or far from the part, that is no matter of edges and silhouettes."""

PIECE = 1_000_000
"""Points that are corrected at a time: 0.6 GB of rays."""

COVERAGE_FACTOR = 2
"""Of expanded uncertainties of what is known well: 95.45 % of a normal distribution."""

COVERED = 0.9772498680518208
"""Of that distribution below twice its standard deviation."""


class CorrectionStatus(PointStatus):
    """Outcome of a measured point.

    Outside the field neither line of sight meets hot air of which anything is known; uncertain is
    an air's share that scatters over an ensemble's members by more than itself; of a point that is
    lost, the refracted ray from a device is not known (`iriftrace.image.aov_image.Status.lost`).
    """

    CORRECTED = 0
    FAR_FROM_PART = 1
    HIDDEN = 2
    SEVERAL_IMAGES = 3
    OUTSIDE_FIELD = 4
    UNCERTAIN = 5
    LOST = 6


_DOUBTFUL = {
    CorrectionStatus.FAR_FROM_PART: "are far from the part or on its outline and stay as they were "
    "measured, beside corrected ones; align the cloud with the part (--cloud-to-part), and take "
    "out what is not the part.",
    CorrectionStatus.HIDDEN: "are hidden from one of the scene's devices, which cannot have "
    "measured them; check where the scene has the devices, and the frame of the cloud "
    "(--cloud-to-part).",
}


@frozen(eq=False)
class Correction:
    """Corrected points.

    Attributes
    ----------
    measured : (n, 3) array, mm, world
    error : (n, 3) array, mm
        The air's share of each; 0 where it is not known.
    status : (n,) array of int
        `CorrectionStatus`; points with another one than 0 stay as they were measured.
    face : (n,) array of int
        Of the part; -1 where the camera's line meets none.
    normal : (n, 3) array
        The part's outward unit normal there.
    system : str
    provenance : dict
        As in `iriftrace.Scan`.
    field_uncertainty : float
        Relative standard uncertainty of the air's contrast, n - n of the ambient air, without its
        unsteadiness; 0 if it is not stated.
    errors : (k, n, 3) array or None, mm
        The air's share by each member of an ensemble, whose mean `error` is; None for one field.
    to_part : (m,) array or None, mm
        Distance of a sample of the measured points from the part.
    state : FieldState
        Whether the air is synthetic, and how far unsteady.
    """

    measured: FloatArray
    error: FloatArray
    status: NDArray[np.int64]
    face: IntArray
    normal: FloatArray
    system: str
    provenance: dict[str, Any]
    field_uncertainty: float = 0.0
    errors: FloatArray | None = None
    to_part: FloatArray | None = None
    state: FieldState = field(factory=FieldState)

    @property
    def u_contrast(self) -> float:
        """Relative standard uncertainty of the air's contrast with its unsteadiness; 0: unknown."""
        if not self.field_uncertainty:
            return 0.0
        return math.hypot(self.field_uncertainty, self.state.unsteadiness or 0.0)

    @property
    def u_normal(self) -> FloatArray | None:
        """(n,) array, mm: standard uncertainty of what was taken out, along the normal.

        The members' standard deviation, and the contrast's uncertainty times the correction, which
        is proportional to it, in quadrature. NaN of points that stay as they are; None where
        neither is known.
        """
        if self.errors is None and not self.u_contrast:
            return None
        found: FloatArray = self.u_contrast * np.einsum("ij,ij->i", self.error, self.normal)
        if self.errors is not None:
            found = np.hypot(found, scatter_along(self.errors, self.normal))
        return np.where(self.status == CorrectionStatus.CORRECTED, np.abs(found), np.nan)

    @property
    def points(self) -> FloatArray:
        """(n, 3) array, mm, world: the measured points without the air's share."""
        return self.measured - self.error

    def features(
        self, part: Part, choices: Sequence[str], gate: float | None = GATE
    ) -> list[dict[str, Any]]:
        """Features of the corrected points, measured and corrected; see `feature_table`.

        Of each size three expanded uncertainties, mm, None where one is not known:
        ``size_uncertainty_mm`` U = k u of the share that was air, with ``coverage_factor`` k by
        Student's t for as many fields as it was estimated from (GUM, annex G), 2 for many or one;
        ``fit_uncertainty_mm`` (k = 2) of the fit to the corrected points, by their scatter;
        ``total_uncertainty_mm``, the root of the sum of their squares. That of synthetic air is not
        known.
        """
        good = self.status == CorrectionStatus.CORRECTED
        measured, face = self.measured[good], self.face[good]
        clouds = {"measured": measured, "corrected": self.points[good]}
        by_member = () if self.errors is None else measured - self.errors[:, good]
        rows = feature_table(clouds, face, part, choices, by_member, gate)
        for row in rows:
            air, factor = self._air_uncertainty(row["size_mm"], row.pop("size_scatter_mm", None))
            u = row["u_size_mm"]["corrected"]
            fit = None if u is None else COVERAGE_FACTOR * u
            row |= {
                "size_uncertainty_mm": air,
                "coverage_factor": factor,
                "fit_uncertainty_mm": fit,
                "total_uncertainty_mm": None
                if air is None or fit is None
                else math.hypot(air, fit),
            }
        return rows

    def _air_uncertainty(
        self, size: dict[str, float | None], scatter: float | None
    ) -> tuple[float | None, float | None]:
        """Expanded uncertainty, mm, of the share of a size that was air, and its k."""
        measured, corrected = size["measured"], size["corrected"]
        known = self.u_normal is not None and not self.state.synthetic
        if measured is None or corrected is None or not known:
            return None, None
        by_field = abs(self.u_contrast * (measured - corrected))
        factor = self._coverage_factor(by_field, scatter or 0.0)
        return factor * math.hypot(by_field, scatter or 0.0), factor

    def _coverage_factor(self, by_field: float, scatter: float) -> float:
        """k for as many degrees of freedom as Welch and Satterthwaite's formula gives (GUM, G.4).

        The field's uncertainty is taken for known; the scatter over n fields has n - 1.
        """
        if self.errors is None or not scatter:
            return COVERAGE_FACTOR
        degrees = (len(self.errors) - 1) * (math.hypot(by_field, scatter) / scatter) ** 4
        return float(stdtrit(degrees, COVERED))

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values, schema ``iriftrace.correction/1``."""
        corrected, u = self.status == CorrectionStatus.CORRECTED, self.u_normal
        return {
            "schema": SCHEMA,
            **self.provenance,
            "system": self.system,
            "points": {"measured": len(self.measured), **CorrectionStatus.counts(self.status)},
            "error_mm": spread(np.linalg.norm(self.error[corrected], axis=1)),
            **({} if u is None else {"u_normal_mm": spread(u[corrected])}),
            **({} if self.to_part is None else {"to_part_mm": spread(self.to_part)}),
            "field_uncertainty": self.field_uncertainty or None,
            "unsteadiness": self.state.unsteadiness,
        }

    def save(self, path: str | Path, features: Sequence[dict[str, Any]] = ()) -> tuple[Path, Path]:
        """Write the corrected cloud (.vtp or .ply), with what was added, and its numbers (.json).

        Parameters
        ----------
        path : path
        features : sequence of dict
            Written with the numbers.

        Raises
        ------
        InputError
            If the name ends neither in .vtp nor in .ply.
        """
        columns: dict[str, NDArray[Any]] = {
            **by_axis("correction", -self.error),
            **({} if self.u_normal is None else {"u_normal": self.u_normal}),
            "status": self.status.astype(np.int32),
        }
        values = self.as_dict() | {"features": list(features)}
        return save_cloud(path, self.points, columns, values)


def correct(
    points: ArrayLike,
    scene: AnyScene,
    camera: Camera | None = None,
    second: Camera | None = None,
    *,
    system: System | None = None,
    phase: Phase | None = None,
    field_uncertainty: float = 0.0,
) -> Correction:
    """Take the air's share out of measured points.

    Of an ensemble of fields the mean of its members' shares, with their scatter as uncertainty.

    Parameters
    ----------
    points : (n, 3) array, mm, world
        Of one scan by these devices, before it was merged with others or aligned.
    scene : Scene, LoadedScene or path
    camera, second, system, phase
        As for `iriftrace.measure`. A laser's sheet is taken to pass through each point.
    field_uncertainty : float
        Relative standard uncertainty of the air's contrast, n - n of the ambient air, which that of
        the correction is proportional to: 0.05 for 5 %.

    Raises
    ------
    InputError
        As `iriftrace.measure`, and if there are no points, some are not finite, none lies on the
        part or can be corrected, or the uncertainty is no share.

    Warns
    -----
    IriftraceWarning
        The shells are too few for the lines of sight; where the field lies beside the scene and no
        engine was asked for, it serves instead.
    """
    measured = np.array(points, dtype=np.float64)
    if measured.ndim != 2 or measured.shape[1:] != (3,) or len(measured) == 0:
        raise InputError(
            f"The cloud is an array of shape {measured.shape}; give n > 0 points, (n, 3), in mm."
        )
    if not np.isfinite(measured).all():
        raise InputError("Some points of the cloud are not finite; leave them out.")
    if not 0.0 <= field_uncertainty < 1.0:
        raise InputError(
            f"The field's uncertainty is {field_uncertainty:g}, but it is a share of the air's "
            "contrast; give one from 0 to 1, such as 0.05 (5 %)."
        )
    loaded, camera, second, system, phase = devices_of(scene, camera, second, system, phase)
    # At random: sensors write every so many rows alike.
    chosen = np.random.default_rng(0).choice(len(measured), min(SAMPLE, len(measured)), False)
    to_part = loaded.part.surface.distance(measured[chosen])
    if np.median(to_part) > REACH_MM:
        raise InputError(
            f"The cloud lies {np.median(to_part):.3g} mm beside the part (median), so it is "
            "another part's, "
            "in another unit (--length-unit) or another frame (--cloud-to-part); give its points "
            "in mm in the frame of the scene."
        )
    members = (loaded,) if loaded.ensemble is None else loaded.ensemble.scenes()
    # Clouds come in any order, and rays side by side are traced faster.
    with np.errstate(divide="ignore", invalid="ignore"):
        pixel, second_pixel = (device.project(measured) for device in (camera, second))
    order = places_in_tiles(pixel)
    # Neither behind a device nor so far beside its picture that its lens has no ray there.
    order = order[np.isfinite(np.hstack((pixel, second_pixel))[order]).all(axis=1)]
    scenes, shares, statuses, faces = [], [], [], []
    for member in members:
        scenes.append(choose_for_devices(member, (camera, second)))
        shares.append(np.zeros_like(measured))
        statuses.append(np.full(len(measured), CorrectionStatus.FAR_FROM_PART, dtype=np.int64))
        faces.append(np.full(len(measured), -1))
        for rows in np.array_split(order, math.ceil(len(order) / PIECE)) if len(order) else ():
            shares[-1][rows], statuses[-1][rows], faces[-1][rows] = _air_share(
                measured[rows], scenes[-1], camera, second, system, phase
            )
    status = np.max(statuses, axis=0)
    if len(shares) > 1:
        scatter, mean = np.std(shares, axis=0, ddof=1), np.mean(shares, axis=0)
        vague = np.linalg.norm(scatter, axis=1) > np.linalg.norm(mean, axis=1)
        status[vague & (status == CorrectionStatus.CORRECTED)] = CorrectionStatus.UNCERTAIN
    if not (status == CorrectionStatus.CORRECTED).any():
        counts = CorrectionStatus.counts(status)
        raise InputError(
            f"None of the {len(status):,} points can be corrected: {counts['far_from_part']:,} are "
            f"far from the part, {counts['hidden']:,} hidden from a device, "
            f"{counts['several_images']:,} have several images, {counts['outside_field']:,} are "
            f"seen through no hot air that is known, of {counts['lost']:,} the rays were lost on "
            f"the way and of {counts['uncertain']:,} the correction "
            "is uncertain by more than itself; the cloud is "
            f"{_across(measured):.3g} mm across and the part {_across(loaded.part.bounds):.3g} mm: "
            "check its unit (--length-unit), its frame (--cloud-to-part) and where the scene has "
            "the devices."
        )
    for code, sentence in _DOUBTFUL.items():
        share = np.mean(status == code)
        if share > MANY:
            warnings.warn(f"{share:.0%} of the points {sentence}", IriftraceWarning, stacklevel=2)
    lost = int((status == CorrectionStatus.LOST).sum())
    warn_of_lost_points(lost, len(status), "stay as they were measured")
    errors = np.where(status[:, None] == CorrectionStatus.CORRECTED, shares, 0.0)
    return Correction(
        measured=measured,
        error=errors.mean(axis=0),
        status=status,
        face=faces[0],
        normal=loaded.part.surface.normals[faces[0]],
        system=system,
        provenance=provenance_of_two(loaded if loaded.ensemble else scenes[0], camera),
        field_uncertainty=field_uncertainty,
        errors=None if len(shares) == 1 else errors,
        to_part=to_part,
        state=field_state(loaded),
    )


def _across(points: FloatArray) -> float:
    """Diagonal of the box around points (n, 3)."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _air_share(
    measured: FloatArray,
    loaded: LoadedScene,
    camera: Camera,
    second: Camera,
    system: System,
    phase: Phase,
) -> tuple[FloatArray, IntArray, IntArray]:
    """`error`, `status` and `face` of points as in `Correction`, in one field."""
    place = measured.copy()
    offsets = np.zeros((2, *measured.shape))
    lacking = np.full((len(measured), 2), np.nan)
    face = np.full(len(measured), -1)
    found, in_air, lost = np.zeros((3, len(measured)), dtype=bool)
    for _ in range(ROUNDS):
        rows = np.flatnonzero(~found & ~lost)
        if len(rows) == 0:
            break
        one, other = (
            lines_of_sight(loaded, device.origin, place[rows], offset[rows], rounds=1)
            for device, offset in zip((camera, second), offsets, strict=True)
        )
        aimed = np.array((one.offset, other.offset))
        moved = np.linalg.norm(aimed - offsets[:, rows], axis=2).max(axis=0)
        offsets[:, rows] = aimed
        lacking[rows] = np.column_stack((one.lacking, other.lacking))
        face[rows] = one.face
        in_air[rows] = one.in_air | other.in_air
        lost[rows] = one.lost | other.lost
        a, b = (
            unit_vectors(place[rows] + offset - device.origin)
            for device, offset in zip((camera, second), aimed, strict=True)
        )
        seen, _ = triangulated(camera, second, a, b, system, phase)
        step = measured[rows] - seen
        place[rows] += step
        moved = np.maximum(moved, np.linalg.norm(step, axis=1))
        found[rows] = moved <= SETTLED_MM
    with np.errstate(invalid="ignore"):
        # NaN where a ray misses the part.
        far = ~(lacking >= -REACH_MM).all(axis=1)
        hidden = (lacking > REACH_MM).any(axis=1)
    status = np.select(
        [lost, ~found, far, hidden, ~in_air],
        [
            CorrectionStatus.LOST,
            CorrectionStatus.SEVERAL_IMAGES,
            CorrectionStatus.FAR_FROM_PART,
            CorrectionStatus.HIDDEN,
            CorrectionStatus.OUTSIDE_FIELD,
        ],
        CorrectionStatus.CORRECTED,
    )
    return measured - place, status, face

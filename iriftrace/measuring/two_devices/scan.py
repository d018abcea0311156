"""The cloud of points that a triangulating sensor measures through hot air, and its error."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import Factory, asdict, evolve, frozen
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import AnyArray, BoolArray, FloatArray, IntArray
from iriftrace.core.html import html_table, picture
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.plain import JsonObject, plain
from iriftrace.core.statistics import spread
from iriftrace.image.coverage import (
    PixelHits,
    places_in_picture,
    places_in_view,
    seen_fractions,
)
from iriftrace.image.lost_rays import LostRay, LostRays
from iriftrace.io.cloud_write import by_axis, save_cloud
from iriftrace.measuring.features.choice import FeatureChoice
from iriftrace.measuring.features.drawing import drawing_cloud
from iriftrace.measuring.features.fitted import FittedFeature, fit_features
from iriftrace.measuring.features.quantity import Quantity
from iriftrace.measuring.features.relations import Relation, relations
from iriftrace.measuring.options import GATE
from iriftrace.measuring.two_devices.acceptance import AcceptanceError
from iriftrace.measuring.two_devices.statistics import (
    PointStatus,
    RegionValues,
    each_along,
    region_values,
    worst_member,
)
from iriftrace.part.growth import Growth
from iriftrace.part.part import Part

SCHEMA = "iriftrace.scan/2"


class ScanStatus(PointStatus):
    """Outcome of a pixel of the device that is traced forward."""

    MEASURED = 0
    NOT_SEEN = 1
    OUTSIDE_PICTURE = 2
    SHADOW = 3
    SEVERAL_IMAGES = 4
    OUT_OF_FOCUS = 5
    LOST = 6


@frozen(eq=False)
class Scan:
    """Measured points and their errors, in the world's frame.

    Attributes
    ----------
    points : (n, 3) array, mm
        Measured points X'.
    true : (n, 3) array, mm
        The points X on the part.
    normal : (n, 3) array
        Outward unit normals of the part at X.
    gap : (n,) array, mm
        Distance of the two straight lines; 0 where a plane was intersected.
    angle : (n,) array, rad
        Between the two straight lines.
    pixel : (n, 2) array, px
        In the camera's picture; pixel centres at whole numbers.
    face : (n,) array of int
        Face of the part, from 0.
    in_air : (n,) array of bool
        The ray of a device meets hot air; of an ensemble in every member that counts.
    status : (h, w) array of int
        `ScanStatus` of every pixel of the device that was traced forward.
    system : str
        ``"stereo"``, ``"fringe"`` or ``"laser"``.
    phase : str
        Direction of the fringes' phase: ``"columns"``, ``"rows"`` or ``"both"``.
    camera, second : Camera
    provenance : dict
        Version, scene, field and part, and the assumptions in force; see
        :func:`iriftrace.tracing.provenance.provenance`.
    errors : (k, n, 3) array or None, mm
        X' - X in the air of each member of an ensemble that was traced; all other values are
        weighted means over the k members. None for one field.
    weights : MemberWeights or None
        Weights of these members.
    numbers : tuple of int
        Their numbers in the ensemble, from 1.
    growth : Growth or None
        Thermal expansion of the part, if known.
    lost : tuple of LostRay
        The first rays that were lost.
    time_s : dict of float, s
        ``load`` and ``build`` of the scene, and ``measure``.
    """

    points: FloatArray
    true: FloatArray
    normal: FloatArray
    gap: FloatArray
    angle: FloatArray
    pixel: FloatArray
    face: IntArray
    in_air: BoolArray
    status: NDArray[np.int64]
    system: str
    phase: str
    camera: Camera
    second: Camera
    provenance: JsonObject
    errors: FloatArray | None = None
    weights: MemberWeights | None = None
    numbers: tuple[int, ...] = ()
    growth: Growth | None = None
    lost: tuple[LostRay, ...] = ()
    time_s: dict[str, float] = Factory(dict)

    def __repr__(self) -> str:
        middle = 1e3 * float(np.median(self.error_normal))
        return f"Scan({len(self.points):,} points, {self.system}, error {middle:.3g} um (median))"

    def _repr_html_(self) -> str:
        """Numbers and picture of the measurement, for notebooks."""
        size = np.abs(self.error_normal)
        rows = {
            "points": f"{len(self.points):,}",
            "error along the normal, median": f"{1e3 * np.median(self.error_normal):.3g} um",
            "its size, 95th percentile": f"{1e3 * np.quantile(size, 0.95):.3g} um",
            "field": self.provenance.get("assumptions", {}).get("field_origin", "not stated"),
        }
        return html_table(f"Simulated {self.system} measurement", rows) + picture(self)

    @property
    def one_line(self) -> bool:
        """The points are those of one line of a laser."""
        return self.system == "laser"

    @property
    def error(self) -> FloatArray:
        """(n, 3) array, mm: X' - X."""
        return self.points - self.true

    @property
    def error_normal(self) -> FloatArray:
        """(n,) array, mm: the error along the outward normal, as a map against the CAD shows it."""
        along: FloatArray = np.einsum("ij,ij->i", self.error, self.normal)
        return along

    @property
    def scatter_normal(self) -> FloatArray | None:
        """(n,) array, mm: standard deviation over the members in the mean along the normal."""
        if self.errors is None or self.weights is None or not self.weights.several:
            return None
        return self.weights.scatter(each_along(self.errors, self.normal))

    @property
    def worst_member(self) -> IntArray | None:
        """(n,) array: number of the member in the mean with the largest error along the normal."""
        if self.errors is None or self.weights is None or not self.weights.several:
            return None
        in_mean = np.flatnonzero(self.weights.weights)
        along = each_along(self.errors[in_mean], self.normal)
        return np.asarray(np.array(self.numbers)[in_mean[np.abs(along).argmax(axis=0)]])

    @property
    def lost_rays(self) -> LostRays | None:
        """The first lost rays, as they are written next to the cloud; None if none was lost."""
        if not self.lost:
            return None
        # Several members may lose the same pixel.
        count = max(int((self.status == ScanStatus.LOST).sum()), len(self.lost))
        return LostRays.of(self.lost, count, self.provenance)

    def _by_member(self) -> JsonObject:
        """JSON values of an ensemble: scatter, and the error by each member in the mean."""
        scatter = self.scatter_normal
        if self.errors is None or scatter is None:
            return {}
        along = dict(zip(self.numbers, each_along(self.errors, self.normal), strict=True))
        rows = [
            {
                **{key: member[key] for key in ("number", "label", "weight")},
                "error_normal_mm": spread(along[member["number"]]),
            }
            for member in self.provenance["ensemble"]["members"]
            if member["weight"]
        ]
        worst = max(rows, key=lambda row: row["error_normal_mm"]["rms"])
        return {
            "scatter_normal_mm": spread(scatter),
            "members": rows,
            "worst_member": worst["number"],
        }

    def best_fit(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rigid-body part of the error, and the residual after best-fit alignment.

        Least squares of the errors along the normals over small motions, x -> x + w x (x - c) + t
        about the cloud's centre c (Chen and Medioni, Image and Vision Computing 10 (1992) 145).
        Motions that no normal determines, such as that of a cylinder along its axis, are left at 0.

        Returns
        -------
        translation : (3,) array, mm
        rotation : (3,) array, rad
        error_normal : (n,) array, mm
            After the alignment.
        """
        arm = self.true - self.true.mean(axis=0)
        motions = np.hstack((self.normal, np.cross(arm, self.normal)))
        found, *_ = np.linalg.lstsq(motions, -self.error_normal, rcond=1e-6)
        return found[:3], found[3:], self.error_normal + motions @ found

    def as_dict(self) -> JsonObject:
        """Plain JSON values, schema `SCHEMA`."""
        translation, rotation, left = self.best_fit()
        return {
            "schema": SCHEMA,
            **self.provenance,
            "system": self.system,
            "phase": self.phase,
            "points": {"pixels": int(self.status.size), **ScanStatus.counts(self.status)},
            "error_normal_mm": spread(self.error_normal),
            "error_mm": spread(np.linalg.norm(self.error, axis=1)),
            **self._by_member(),
            "gap_mm": spread(self.gap),
            "angle_deg": spread(np.degrees(self.angle)),
            "best_fit": {
                "translation_mm": translation.tolist(),
                "rotation_rad": rotation.tolist(),
                "error_normal_mm": spread(left),
            },
            "growth": None if self.growth is None else asdict(self.growth),
            "devices": {"camera": self.camera.as_dict(), "second": self.second.as_dict()},
            "time_s": self.time_s,
        }

    def features(
        self, part: Part, choices: Sequence[str | FeatureChoice] = (), gate: float | None = GATE
    ) -> tuple[FittedFeature, ...]:
        """Features of the points, ``"cold"`` and ``"measured"``; see `fit_features`.

        Of an expanded part also those of the cold points carried back onto its ``"drawing"``. Of an
        ensemble the size has its scatter over the members, and the member by which it is farthest
        from the cold one.
        """
        clouds = {"cold": self.true, "measured": self.points}
        clouds |= drawing_cloud(self.true, self.face, part)
        by_member = () if self.errors is None else self.true + self.errors
        line = self.one_line
        fitted = fit_features(clouds, self.face, part, choices, by_member, gate, one_line=line)
        return tuple(evolve(each, size=self._with_scatter(each.size)) for each in fitted)

    def seen_fractions(self, part: Part, chosen: BoolArray | None = None) -> FloatArray:
        """(m,) fraction of the area of each face on which points are measured, 0..1.

        Of a laser's line, the width of a pixel. `chosen` (n,) are the points that count, all by
        default.
        """
        width, height = self.camera.resolution
        points = np.flatnonzero(np.ones(len(self.face)) if chosen is None else chosen)
        column, row = np.rint(self.pixel[points]).astype(np.int64).T
        pixel = row * width + column
        # Pixels of the part without a point count as hits of a face that is not measured.
        face = np.ones(width * height, dtype=np.int64)
        if not self.one_line:
            face[self.status.ravel() == ScanStatus.NOT_SEEN] = 0
        face[pixel] = self.face[points] + 1
        position = np.zeros((3, width * height))
        position[:, pixel] = self.true[points].T
        sees = np.zeros(width * height, dtype=np.bool_)
        sees[pixel] = True
        x, y, z = position
        hits = PixelHits(face, (x, y, z), sees)
        first, second = (places_in_view(part, d) for d in (self.camera, self.second))
        both = np.intersect1d(first, second, assume_unique=True)
        return seen_fractions(part, places_in_picture(part, self.camera, both, hits))

    def relations(self, features: Sequence[FittedFeature]) -> tuple[Relation, ...]:
        """Distances and angles between `features`, with the same statements."""
        return tuple(
            evolve(each, value=self._with_scatter(each.value)) for each in relations(features)
        )

    def _with_scatter(self, value: Quantity) -> Quantity:
        true = value.by_cloud["cold"]
        if self.weights is None or not self.weights.several or true is None:
            return value
        members = np.array(value.by_member, dtype=np.float64)
        worst = worst_member(members, true, self.weights, self.numbers)
        return evolve(value, scatter=float(self.weights.scatter(members)), worst=worst)

    def regions(self, part: Part) -> tuple[RegionValues, ...]:
        """Errors along the normal by region of the part."""
        return region_values(part, self.face, self.error_normal, one_line=self.one_line)

    def values(
        self,
        features: Sequence[FittedFeature] = (),
        acceptance: Sequence[AcceptanceError] = (),
        regions: Sequence[RegionValues] = (),
        related: Sequence[Relation] = (),
    ) -> JsonObject:
        """Plain JSON values that `save` writes next to the cloud, whose parameters these are."""
        return {
            **self.as_dict(),
            "features": [each.as_dict() for each in features],
            "relations": [each.as_dict() for each in related],
            "regions": plain(regions),
            **({"acceptance": plain(acceptance)} if acceptance else {}),
        }

    def save(
        self,
        path: str | Path,
        features: Sequence[FittedFeature] = (),
        acceptance: Sequence[AcceptanceError] = (),
        regions: Sequence[RegionValues] = (),
        related: Sequence[Relation] = (),
    ) -> tuple[Path, Path]:
        """Write the cloud and, next to it, its numbers (.json).

        Parameters
        ----------
        path : path
        features, acceptance, regions, related : sequences
            Written with the numbers.

        Raises
        ------
        InputError
            If the name ends in none of `iriftrace.io.cloud_write.WRITTEN`.
        """
        values = self.values(features, acceptance, regions, related)
        scatter, worst = self.scatter_normal, self.worst_member
        columns: dict[str, AnyArray] = {
            **by_axis("true", self.true),
            **by_axis("error", self.error),
            "error_normal": self.error_normal,
            **({} if scatter is None else {"scatter_normal": scatter}),
            **({} if worst is None else {"worst_member": worst.astype(np.int32)}),
            "gap": self.gap,
            "angle": self.angle,
            "pixel_u": self.pixel[:, 0],
            "pixel_v": self.pixel[:, 1],
            "face": self.face.astype(np.int32),
            # The cloud consists of the points that were measured.
            "status": np.full(len(self.points), ScanStatus.MEASURED, dtype=np.int32),
        }
        return save_cloud(path, self.points, columns, values)

"""Corrected points: their uncertainty, their features, and the file that holds them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import asdict, evolve, field, frozen
from numpy.typing import NDArray
from scipy.special import stdtrit

from iriftrace.core.arrays import AnyArray, BoolArray, FloatArray, IntArray
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.mesh.transform import apply
from iriftrace.core.plain import JsonObject, plain
from iriftrace.core.statistics import spread
from iriftrace.core.units import length_factor
from iriftrace.io.cloud_write import by_axis, save_cloud
from iriftrace.io.clouds import Cloud
from iriftrace.measuring.features.choice import FeatureChoice, on_region
from iriftrace.measuring.features.drawing import drawing_cloud
from iriftrace.measuring.features.fitted import FittedFeature, fit_features
from iriftrace.measuring.features.quantity import DRAWING, Quantity, Uncertainty
from iriftrace.measuring.features.relations import Relation, relations
from iriftrace.measuring.options import GATE, NONE_STATED, Uncertainties
from iriftrace.measuring.two_devices.larger import Larger
from iriftrace.measuring.two_devices.statistics import (
    PointStatus,
    RegionValues,
    each_along,
    region_values,
    worst_member,
)
from iriftrace.medium.source import FieldKind
from iriftrace.part.growth import Growth
from iriftrace.part.part import Part
from iriftrace.tracing.hot_air import OUTSIDE
from iriftrace.tracing.scene import Scene

SCHEMA = "iriftrace.correction/2"

COVERAGE_FACTOR = 2
"""Coverage factor of well-known expanded uncertainties: 95.45 % of a normal distribution."""

COVERED = 0.9772498680518208
"""Fraction of that distribution below twice its standard deviation."""

_RANGE = 2.0 * math.sqrt(3.0)
"""Range over standard deviation of a value that may lie anywhere in between (GUM, 4.3.7)."""


class CorrectionStatus(PointStatus):
    """Outcome of a measured point.

    Outside the field, neither line of sight meets hot air of which anything is known. A point is
    lost if the refracted ray from a device is not known (`iriftrace.image.aov_image.Status.lost`).
    It is outside the view if it lies behind a device, or so far outside its picture that its lens
    has no ray there. Rows of the cloud's file that are not a point are not measured. An uncertain
    point is corrected like others, by the mean, but its correction scatters over an ensemble's
    members by more than itself.
    """

    CORRECTED = 0
    FAR_FROM_PART = 1
    HIDDEN = 2
    SEVERAL_IMAGES = 3
    OUTSIDE_FIELD = 4
    UNCERTAIN = 5
    LOST = 6
    OUTSIDE_VIEW = 7
    NOT_MEASURED = 8


def is_corrected(status: IntArray) -> BoolArray:
    """Mask (n,) of the points whose outcome (n,) is a correction."""
    return np.isin(status, (CorrectionStatus.CORRECTED, CorrectionStatus.UNCERTAIN))


@frozen
class FieldState:
    """What the file of a scene's field states about the uncertainty of a correction."""

    synthetic: bool = False  # air from formulas, whose uncertainty is not known
    # Relative standard uncertainty of the air's contrast because it changes in time while a scan
    # sees one state; 0 for steady air and where nothing is stated, None for unsteady air whose
    # changes are not stated.
    unsteadiness: float | None = 0.0

    @classmethod
    def of(cls, scene: Scene) -> FieldState:
        """State of a scene's field; the scatter of an ensemble's fields has their unsteadiness."""
        if not scene.members:
            sources = [scene.compiled.source]
        else:
            sources = [member.source for member in scene.members]
        kinds = [source.facts.kind for source in sources if source is not None]
        if scene.compiled.source is None or scene.members or FieldKind.UNSTEADY not in kinds:
            return cls(synthetic=FieldKind.SYNTHETIC in kinds)
        facts, heating_k = scene.compiled.source.facts, scene.compiled.stated.heating_k
        if facts.heat_variation is None or facts.plume_swing_k is None or heating_k is None:
            return cls(unsteadiness=None)
        # The larger of heat flow's and plume's relative range, as a rectangular distribution.
        relative = max(facts.heat_variation, facts.plume_swing_k / heating_k)
        return cls(unsteadiness=relative / _RANGE)


@frozen(eq=False)
class Correction:
    """Corrected points.

    Attributes
    ----------
    measured : (n, 3) array, mm, world
    error : (n, 3) array, mm
        Refraction error of each; 0 where it is not known.
    status : (n,) array of int
        `CorrectionStatus`; see `corrected`.
    face : (n,) array of int
        Of the part; -1 where the camera's line meets none.
    normal : (n, 3) array
        The part's outward unit normal there.
    system : str
    provenance : dict
        As in `iriftrace.Scan`.
    uncertainties : Uncertainties
        As stated; without the part of the field's that comes from unsteady air.
    errors : (k, n, 3) array or None, mm
        Refraction error by each member of an ensemble, whose weighted mean `error` is; None for
        one field.
    weights : MemberWeights or None
        Of the members.
    to_part : (m,) array or None, mm
        Distance of a sample of the measured points in a box around the part from it.
    larger : Larger or None
        By how much the cloud is larger than the part, where that explains most of its distance.
    growth : Growth or None
        Thermal expansion of the part, with the hot temperature for which sizes hold; None where it
        is not known.
    state : FieldState
        Whether the air is synthetic, and how unsteady it is.
    one_line : bool
        The points are those of one line of a laser.
    """

    measured: FloatArray
    error: FloatArray
    status: NDArray[np.int64]
    face: IntArray
    normal: FloatArray
    system: str
    provenance: JsonObject
    uncertainties: Uncertainties = NONE_STATED
    errors: FloatArray | None = None
    weights: MemberWeights | None = None
    to_part: FloatArray | None = None
    larger: Larger | None = None
    growth: Growth | None = None
    state: FieldState = field(factory=FieldState)
    one_line: bool = False

    @property
    def corrected(self) -> BoolArray:
        """(n,) mask of the points that are corrected, uncertain ones too."""
        return is_corrected(self.status)

    @property
    def u_contrast(self) -> float:
        """Relative standard uncertainty of the air's contrast with unsteadiness; 0: unknown."""
        stated = self.uncertainties.field_uncertainty
        if not stated:
            return 0.0
        return math.hypot(stated, self.state.unsteadiness or 0.0)

    @property
    def u_normal(self) -> FloatArray | None:
        """(n,) array, mm: standard uncertainty of the correction along the normal.

        Root sum of squares of that of the members' mean (`MemberWeights.uncertainty`) and of the
        contrast's uncertainty times the correction, which is proportional to the contrast. NaN for
        points without a correction; None where neither is known.
        """
        if self.errors is None and not self.u_contrast:
            return None
        found: FloatArray = self.u_contrast * np.einsum("ij,ij->i", self.error, self.normal)
        if self.errors is not None and self.weights is not None:
            along = each_along(self.errors, self.normal)
            found = np.hypot(found, self.weights.uncertainty(along))
        return np.where(self.corrected, np.abs(found), np.nan)

    @property
    def points(self) -> FloatArray:
        """(n, 3) array, mm, world: the measured points without their refraction error."""
        return self.measured - self.error

    def features(
        self,
        part: Part,
        choices: Sequence[str | FeatureChoice] = (),
        gate: float | None = GATE,
    ) -> tuple[FittedFeature, ...]:
        """Features of the corrected points; see `fit_features`.

        The clouds are ``"measured"``, ``"corrected"``, and of an expanded part ``"drawing"``, the
        corrected points carried back onto its drawing. Sizes have their uncertainties (that of the
        air is not known for synthetic air), and of an ensemble the member by which they are
        farthest from the mean.
        """
        good = self.corrected
        measured, face, points = self.measured[good], self.face[good], self.points[good]
        clouds = {"measured": measured, "corrected": points, **drawing_cloud(points, face, part)}
        by_member = () if self.errors is None else measured - self.errors[:, good]
        line = self.one_line
        fitted = fit_features(clouds, face, part, choices, by_member, gate, one_line=line)
        stays = self.face[~good & (self.face >= 0)]
        return tuple(
            evolve(
                each,
                size=self._with_uncertainty(each.size),
                not_corrected=int(on_region(each.region, stays, part).sum()),
            )
            for each in fitted
        )

    def relations(self, features: Sequence[FittedFeature]) -> tuple[Relation, ...]:
        """Distances and angles between `features`, with the same statements."""
        return tuple(
            evolve(each, value=self._with_uncertainty(each.value)) for each in relations(features)
        )

    def _with_uncertainty(self, value: Quantity) -> Quantity:
        measured, corrected = value.by_cloud["measured"], value.by_cloud["corrected"]
        if measured is None or corrected is None:
            return value
        scatter, worst = 0.0, None
        if self.weights is not None:
            members = np.array(value.by_member, dtype=np.float64)
            scatter = float(self.weights.uncertainty(members - measured))
            worst = worst_member(members, corrected, self.provenance)
        drawn = value.by_cloud.get(DRAWING)
        sources = {
            "air": self._u_air(measured - corrected, scatter),
            "fit": value.u["corrected" if drawn is None else DRAWING],
        }
        if drawn is not None and self.growth is not None:
            angle = value.unit == "deg"
            sources["expansion"] = self.uncertainties.of_growth(
                self.growth, corrected, drawn, angle
            )
        known = {name: u for name, u in sources.items() if u is not None}
        parts = dict(sorted(known.items(), key=lambda part: -part[1]))
        missing = tuple(name for name in sources if name not in known)
        if OUTSIDE in self.provenance.get("assumptions", {}):
            missing += ("air outside the members",)
        factor = self._coverage_factor(math.hypot(*parts.values()), scatter)
        return evolve(value, uncertainty=Uncertainty(parts, factor, missing), worst=worst)

    def _u_air(self, removed: float, scatter: float) -> float | None:
        """Standard uncertainty of what was removed from a value; None if it is not known."""
        if self.u_normal is None or self.state.synthetic:
            return None
        return math.hypot(self.u_contrast * removed, scatter)

    def _coverage_factor(self, total: float, scatter: float) -> float:
        """k for as many degrees of freedom as Welch and Satterthwaite's formula gives (GUM, G.4).

        The `scatter` over n equally weighted fields has n - 1 degrees of freedom; the other parts
        of the `total` standard uncertainty are assumed to be exact.
        """
        if self.weights is None or not scatter:
            return COVERAGE_FACTOR
        own = self.weights.degrees_of_freedom
        degrees = own * (total / scatter) ** 4
        if math.isinf(degrees):
            return COVERAGE_FACTOR
        return float(stdtrit(degrees, COVERED))

    def as_dict(self) -> JsonObject:
        """Plain JSON values, schema `SCHEMA`."""
        corrected, u = self.corrected, self.u_normal
        return {
            "schema": SCHEMA,
            **self.provenance,
            "system": self.system,
            "points": {
                "measured": len(self.measured),
                **CorrectionStatus.counts(self.status),
                CorrectionStatus.CORRECTED.key: int(corrected.sum()),
            },
            "error_mm": spread(np.linalg.norm(self.error[corrected], axis=1)),
            **({} if u is None else {"u_normal_mm": spread(u[corrected])}),
            **({} if self.to_part is None else {"to_part_mm": spread(self.to_part)}),
            **({} if self.larger is None else {"larger": asdict(self.larger)}),
            "growth": None if self.growth is None else asdict(self.growth),
            "field_uncertainty": self.uncertainties.field_uncertainty or None,
            "unsteadiness": self.state.unsteadiness,
        }

    def regions(self, part: Part) -> tuple[RegionValues, ...]:
        """Corrections along the normal by region of the part."""
        good = self.corrected
        along = np.einsum("ij,ij->i", self.error, self.normal)
        return region_values(part, self.face[good], along[good], one_line=self.one_line)

    def save(
        self,
        path: str | Path,
        features: Sequence[FittedFeature] = (),
        regions: Sequence[RegionValues] = (),
        related: Sequence[Relation] = (),
        *,
        cloud: Cloud | None = None,
        motion: FloatArray | None = None,
        in_cloud_frame: bool = False,
    ) -> tuple[Path, Path]:
        """Write the corrected cloud, with what was added to each point, and its numbers (.json).

        Parameters
        ----------
        path : path
        features, regions, related : sequences
            Of `features`, `regions` and `relations`, written with the numbers.
        cloud : Cloud, optional
            The cloud whose `points` were corrected: all of its rows are written in their order,
            with its further columns. Rows that were not measured are written unchanged.
        motion : (4, 4) array, mm, optional
            Rigid motion from the frame of the cloud to that of the scene, which was applied to it.
        in_cloud_frame : bool
            Write the cloud in its own frame and unit instead of in mm in the scene's frame.

        Raises
        ------
        InputError
            If the name ends in none of `iriftrace.io.cloud_write.WRITTEN`.
        """
        moved = np.eye(4) if motion is None else motion
        unit = cloud.unit if cloud is not None and in_cloud_frame else "mm"
        back = np.asarray(np.linalg.inv(moved) if in_cloud_frame else np.eye(4), dtype=np.float64)
        factor = 1.0 / length_factor(unit)
        u = {} if self.u_normal is None else {"u_normal": factor * self.u_normal}
        added = {**by_axis("correction", factor * (-self.error @ back[:3, :3].T)), **u}
        points, status = factor * apply(back, self.points), self.status.astype(np.int32)
        values = self.as_dict() | {
            "features": [each.as_dict() for each in features],
            "relations": [each.as_dict() for each in related],
            "regions": plain(regions),
            "cloud": {"frame": "cloud" if in_cloud_frame else "scene", "length_unit": unit},
        }
        if cloud is None:
            columns: dict[str, AnyArray] = {**added, "status": status}
            return save_cloud(path, points, columns, values, unit=unit)
        values["points"] |= {"not_measured": int((~cloud.measured).sum())}
        rows = cloud.rows.copy()
        rows[cloud.measured] = points
        further = cloud.columns if in_cloud_frame else cloud.turned_columns(moved[:3, :3])
        columns = dict(further)
        for name, column in added.items():
            columns[name] = np.full(len(rows), np.nan if name == "u_normal" else 0.0)
            columns[name][cloud.measured] = column
        columns["status"] = np.full(len(rows), CorrectionStatus.NOT_MEASURED, dtype=np.int32)
        columns["status"][cloud.measured] = status
        return save_cloud(
            path, rows, columns, values, unit=unit, measured=cloud.measured, remarks=cloud.remarks
        )

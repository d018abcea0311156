"""Corrected points: their uncertainty, their features, and the file that holds them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from attrs import asdict, evolve, field, frozen
from numpy.typing import NDArray

from iriftrace.core.arrays import AnyArray, AnyIntArray, BoolArray, FloatArray, as_float64
from iriftrace.core.blocks import CloudBlocks, by_block
from iriftrace.core.errors import without_warnings
from iriftrace.core.html import html_table, picture
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.mesh.transform import apply
from iriftrace.core.mesh.triangles import row_lengths
from iriftrace.core.plain import JsonObject, plain
from iriftrace.core.statistics import spread
from iriftrace.core.units import length_factor
from iriftrace.io.cloud_write import by_axis, save_blocks
from iriftrace.io.clouds import Cloud
from iriftrace.measuring.features.choice import FeatureChoice, on_region
from iriftrace.measuring.features.drawing import drawing_cloud
from iriftrace.measuring.features.feature import Feature
from iriftrace.measuring.features.fitted import (
    FittedFeature,
    check_names,
    fit_features,
    is_worse,
    warn_of_worse,
)
from iriftrace.measuring.features.quantity import Quantity
from iriftrace.measuring.features.relations import Relation, relations
from iriftrace.measuring.options import GATE
from iriftrace.measuring.two_devices.changes import Changes
from iriftrace.measuring.two_devices.correction_status import CorrectionStatus, is_corrected
from iriftrace.measuring.two_devices.larger import Larger
from iriftrace.measuring.two_devices.statistics import RegionValues, region_values
from iriftrace.measuring.two_devices.uncertain_value import SENSOR, with_uncertainty
from iriftrace.measuring.uncertainty.air_groups import BEYOND, OTHER_AIR, AirGroups
from iriftrace.measuring.uncertainty.decision import Tolerance
from iriftrace.measuring.uncertainty.inputs import NOTHING_STATED, Inputs
from iriftrace.medium.part_fit import LARGEST_BARE_SHARE
from iriftrace.part.growth import Growth
from iriftrace.part.part import Part

SCHEMA = "iriftrace.correction/2"


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
    face_normals : (m, 3) array
        Outward unit normals of the part's faces; see `normal`.
    system : str
    provenance : dict
        As in `iriftrace.Scan`.
    inputs : Inputs
        Stated standard uncertainties.
    groups : AirGroups
        What is known of the uncertainty of the air's effect.
    errors : (k, n, 3) array or None, mm
        Refraction error by each member of an ensemble, whose weighted mean `error` is; for fields
        that were solved again with an input of no stated uncertainty that of the field they vary.
        None for one field.
    to_part : (m,) array or None, mm
        Distance of a sample of the measured points in a box around the part from it.
    larger : Larger or None
        By how much the cloud is larger than the part, where that explains most of its distance.
    growth : Growth or None
        Thermal expansion of the part, with the hot temperature for which sizes hold; None where it
        is not known.
    one_line : bool
        The points are those of one line of a laser.
    changes : tuple of Changes
        Changes of the error at a sample of points by further groups of inputs.
    without_noise : bool
        The points are simulated, so that their scatter about a feature is not that of a sensor.
    """

    measured: FloatArray
    error: FloatArray
    status: NDArray[np.integer[Any]]
    face: AnyIntArray
    face_normals: FloatArray
    system: str
    provenance: JsonObject
    inputs: Inputs = NOTHING_STATED
    groups: AirGroups = field(factory=AirGroups)
    errors: FloatArray | None = None
    to_part: FloatArray | None = None
    larger: Larger | None = None
    growth: Growth | None = None
    one_line: bool = False
    changes: tuple[Changes, ...] = ()
    without_noise: bool = False

    def _repr_html_(self) -> str:
        """Numbers and picture of the correction, for notebooks."""
        moved = np.linalg.norm(self.error[self.corrected], axis=1)
        rows = {
            "points": f"{int(self.corrected.sum()):,} of {len(self.measured):,} corrected",
            "refraction error, median": f"{1e3 * np.median(moved):.3g} um",
            "95th percentile": f"{1e3 * np.quantile(moved, 0.95):.3g} um",
            "not known of U": ", ".join(self.groups.missing) or "nothing",
        }
        return html_table(f"Corrected {self.system} measurement", rows) + picture(self)

    @property
    def corrected(self) -> BoolArray:
        """(n,) mask of the points that are corrected, uncertain ones too."""
        return is_corrected(self.status)

    @property
    def weights(self) -> MemberWeights | None:
        """Weights of an ensemble's members; None for one field."""
        return self.groups.weights

    @property
    def normal(self) -> FloatArray:
        """(n, 3) array: the part's outward unit normal at each point."""
        return self.face_normals[self.face]

    @property
    def along_normal(self) -> FloatArray:
        """(n,) array, mm: the error along the normal."""
        return by_block(len(self.face), lambda rows: self._along_normal(self.error[rows], rows))

    def _along_normal(self, errors: FloatArray, rows: slice) -> FloatArray:
        """Components (..., n) along the normal of errors (..., n, 3), mm, of a block of points."""
        normal = self.face_normals[self.face[rows]]
        return as_float64(np.einsum("...ij,ij->...i", errors, normal))

    @cached_property
    def u_normal(self) -> FloatArray | None:
        """(n,) array, mm: standard uncertainty of each point along the normal.

        By the groups of the air and that of the sensor. NaN for points without a correction; None
        where nothing is known of the air.
        """
        return self._by_groups(lambda errors, rows: self._along_normal(errors, rows)[..., None])

    @cached_property
    def u(self) -> FloatArray | None:
        """(n,) array, mm: that of the place, the root of the sum of the variances of x, y and z."""
        return self._by_groups(lambda errors, _: errors)

    def _by_groups(self, parts: Callable[[FloatArray, slice], FloatArray]) -> FloatArray | None:
        """Standard uncertainty (n,), mm, of components (..., n, c) of errors (..., n, 3)."""
        if not self.groups.known:
            return None

        def values(rows: slice) -> FloatArray:
            by_member = None if self.errors is None else parts(self.errors[:, rows], rows)
            totals = self.groups.total(parts(self.error[rows], rows), by_member)
            found = np.hypot(np.linalg.norm(totals, axis=1), self.inputs.sensor_mm or 0.0)
            return np.where(is_corrected(self.status[rows]), found, np.nan)

        return by_block(len(self.status), values)

    @property
    def points(self) -> FloatArray:
        """(n, 3) array, mm, world: the measured points without their refraction error."""
        return self.measured - self.error

    def features(
        self,
        part: Part,
        choices: Sequence[str | FeatureChoice] = (),
        gate: float | None = GATE,
        *,
        tolerances: Mapping[str, Tolerance] = {},
    ) -> tuple[FittedFeature, ...]:
        """Features of the corrected points; see `fit_features`.

        The clouds are ``"measured"``, ``"corrected"``, and of an expanded part ``"drawing"``, the
        corrected points carried back onto its drawing. Sizes have their uncertainties by group
        (the air is not known for synthetic air), of an ensemble the member by which they are
        farthest from the mean, and the verdict on those of `tolerances`, by the names of features,
        such as "cylinder:bore". Raises InputError for a tolerance of no fitted feature, or of one
        without one diameter, such as a cone.
        """
        good, points = self.corrected, self.points
        drawn = drawing_cloud(points, self.face, part)
        clouds = {"measured": self.measured, "corrected": points, **drawn}
        by_member = () if self.errors is None else self.measured - self.errors
        fitted = fit_features(
            *(clouds, self.face, part, choices, by_member, gate),
            one_line=self.one_line,
            scatter_mm=self.inputs.sensor_mm,
            among=good,
        )
        warn_of_worse(fitted)
        refits = {one.group: self._refitted(one, part, fitted, gate) for one in self.changes}
        fitted = tuple(
            each.with_groups(
                {g: fits[each.name] for g, fits in refits.items() if each.name in fits}
            )
            for each in fitted
        )
        stays = self.face[~good & (self.face >= 0)]
        doubts = {each.name: self._doubts(each, part) for each in fitted}
        check_names(tolerances, [one.name for one in fitted])
        return tuple(
            evolve(
                each,
                size=self._with_uncertainty(
                    each.size, tolerances.get(each.name), doubts=doubts[each.name]
                ),
                not_corrected=int(on_region(each.region, stays, part).sum()),
                doubts=doubts[each.name],
            )
            for each in fitted
        )

    def _doubts(self, feature: FittedFeature, part: Part) -> tuple[str, ...]:
        """`FittedFeature.doubts`."""
        status = self.status[on_region(feature.region, self.face, part) & (self.face >= 0)]
        beyond = np.mean(status == CorrectionStatus.OUTSIDE_FIELD) > LARGEST_BARE_SHARE
        unknown_noise = self.without_noise and self.inputs.sensor_mm is None
        found = {OTHER_AIR: is_worse(feature), BEYOND: beyond, SENSOR: unknown_noise}
        return tuple(name for name, doubted in found.items() if doubted)

    def _refitted(
        self, change: Changes, part: Part, fitted: Sequence[FittedFeature], gate: float | None
    ) -> dict[str, tuple[Feature, ...]]:
        """`FittedFeature.by_group` of one group for each feature by its name."""
        points = self.measured[change.rows] - self.error[change.rows]
        choices = [FeatureChoice(each.kind, each.region or "") for each in fitted]
        with without_warnings():
            found = fit_features(
                *({"corrected": points}, self.face[change.rows], part, choices),
                *(points - change.errors, gate),
                one_line=self.one_line,
            )
        return {each.name: (each.fits["corrected"], *each.by_member) for each in found}

    def relations(self, features: Sequence[FittedFeature]) -> tuple[Relation, ...]:
        """Distances and angles between `features`, with the same statements."""
        doubts = {one.region: one.doubts for one in features if one.kind == "plane"}
        return tuple(
            evolve(
                each,
                value=self._with_uncertainty(
                    each.value,
                    doubts=sorted({name for one in each.regions for name in doubts.get(one, ())}),
                ),
            )
            for each in relations(features)
        )

    def _with_uncertainty(
        self, value: Quantity, tolerance: Tolerance | None = None, *, doubts: Sequence[str]
    ) -> Quantity:
        known = self.groups, self.inputs, self.changes, self.growth
        return with_uncertainty(value, *known, tolerance, doubts=doubts)

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
            "error_mm": spread(row_lengths(self.error)[corrected]),
            **({} if u is None else {"u_normal_mm": spread(u[corrected])}),
            **({} if self.to_part is None else {"to_part_mm": spread(self.to_part)}),
            **({} if self.larger is None else {"larger": asdict(self.larger)}),
            "growth": None if self.growth is None else asdict(self.growth),
            "inputs": plain(self.inputs),
        }

    def regions(self, part: Part) -> tuple[RegionValues, ...]:
        """Corrections along the normal by region of the part."""
        good = self.corrected
        along = self.along_normal[good]
        return region_values(part, self.face[good], along, one_line=self.one_line)

    def values(
        self,
        features: Sequence[FittedFeature] = (),
        regions: Sequence[RegionValues] = (),
        related: Sequence[Relation] = (),
        *,
        cloud: Cloud | None = None,
        in_cloud_frame: bool = False,
    ) -> JsonObject:
        """Plain JSON values that `save` writes next to the cloud, whose parameters these are."""
        unit = cloud.unit if cloud is not None and in_cloud_frame else "mm"
        values = self.as_dict() | {
            "features": [each.as_dict() for each in features],
            "relations": [each.as_dict() for each in related],
            "regions": plain(regions),
            "cloud": {"frame": "cloud" if in_cloud_frame else "scene", "length_unit": unit},
        }
        if cloud is not None:
            values["cloud"] |= {"saved": cloud.saved, **plain(cloud.origin or {})}
            values["points"] |= {"not_measured": int((~cloud.measured).sum())}
        return values

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
        values = self.values(features, regions, related, cloud=cloud, in_cloud_frame=in_cloud_frame)
        u = {name: each for name in ("u_normal", "u") if (each := getattr(self, name)) is not None}

        def written(rows: slice) -> tuple[FloatArray, dict[str, AnyArray]]:
            """Places and added columns of a block of points."""
            measured, error = self.measured[rows], self.error[rows]
            added: dict[str, AnyArray] = {
                **by_axis("correction", factor * (-error @ back[:3, :3].T)),
                **{name: factor * each[rows] for name, each in u.items()},
                "status": self.status[rows].astype(np.int32),
            }
            return factor * apply(back, measured - error), added

        if cloud is None:
            return save_blocks(path, CloudBlocks(len(self.status), written), values, unit=unit)
        further = cloud.columns if in_cloud_frame else cloud.turned_columns(moved[:3, :3])
        unknown = {**dict.fromkeys(u, np.nan), "status": CorrectionStatus.NOT_MEASURED}

        def completed(rows: slice) -> tuple[FloatArray, dict[str, AnyArray]]:
            """Places and columns of a block of the cloud's rows."""
            there, places = cloud.measured[rows], cloud.rows[rows].copy()
            first = int(np.count_nonzero(cloud.measured[: rows.start]))
            places[there], added = written(slice(first, first + int(there.sum())))
            columns = {name: column[rows] for name, column in further.items()}
            for name, column in added.items():
                columns[name] = np.full(len(there), unknown.get(name, 0.0), dtype=column.dtype)
                columns[name][there] = column
            return places, columns

        return save_blocks(
            path,
            CloudBlocks(len(cloud.rows), completed),
            values,
            unit=unit,
            measured=cloud.measured,
            remarks=cloud.remarks,
        )

"""Reduce the AOV image of one pose to the numbers for comparing poses."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
from attrs import asdict, evolve, frozen, has
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import write_json
from iriftrace.core.plain import JsonObject
from iriftrace.image.aov_image import AovImage, Status
from iriftrace.image.coverage import Coverage, places_seen, pose_coverage
from iriftrace.image.ray_statistics import (
    FEWEST_RAYS,
    UNKNOWN,
    EnsembleMetrics,
    RayCounts,
    Statistics,
    ensemble_metrics,
)
from iriftrace.image.rays import PoseRays, bending, rays_that_count
from iriftrace.image.resolution import step_spacing
from iriftrace.part.part import Part

SCHEMA = "iriftrace.pose/2"
"""Value of ``schema`` in the JSON."""

TIMES = (
    *("load", "build", "straight", "refracted", "check", "metrics", "write", "figures", "total"),
)
"""Keys of `PoseMetrics.time_s`; ``check`` is the check of the shells by a sample of the rays."""

_RAYS_PER_FACE = 4


@frozen(eq=False, kw_only=True, repr=False)
class ViewMetrics:
    """Numbers of the part or of one of its regions in one pose.

    Lengths in mm, angles in degrees, shifts in pixels, coverages from 0 to 1. Numbers computed from
    fewer than `FEWEST_RAYS` good rays are None.
    """

    rays: RayCounts
    displacement_mm: Statistics = UNKNOWN
    # Means of the displacement's lengths across and along the line of sight.
    displacement_lateral_mm: float | None = None
    displacement_axial_mm: float | None = None
    shift_px: Statistics = UNKNOWN  # of the shift in the picture
    # Mean step to the next pixel's hit, across and along the optical axis; see
    # `iriftrace.image.resolution`.
    lateral_resolution_mm: float | None = None
    axial_resolution_mm: float | None = None
    incidence_angle_deg: float | None = None  # mean
    coverage_area: float | None = None  # area seen, over the whole area
    coverage: float | None = None  # the paper's: area of the faces that rays hit, over the whole
    ensemble: EnsembleMetrics | None = None  # scatter, for the image of several fields

    def as_dict(self) -> JsonObject:
        """Plain JSON values, as in the file."""
        found = {key: getattr(self, key) for key in ViewMetrics.__annotations__}
        values = {key: asdict(one) if has(type(one)) else one for key, one in found.items()}
        del values["shift_px"]["rms"], values["rays"]["launched"], values["rays"]["open_boundary"]
        if self.ensemble is None:
            del values["ensemble"]
        else:
            values["ensemble"]["bias_mm"] = dict(values["displacement_mm"])
            values["ensemble"]["bias_px"] = dict(values["shift_px"])
        return values

    def __repr__(self) -> str:
        moved, name = self.displacement_mm, type(self).__name__
        if moved.median is None or moved.p95 is None:
            return f"{name}({self.rays.good} good rays, fewer than {FEWEST_RAYS}: no numbers)"
        return (
            f"{name}({self.rays.good} good rays, displacement median {1e3 * moved.median:.4g} um, "
            f"p95 {1e3 * moved.p95:.4g} um)"
        )


_STEPS = ("lateral_resolution_mm", "axial_resolution_mm")


@frozen(eq=False, kw_only=True, repr=False)
class PoseMetrics(ViewMetrics):
    """Numbers of one pose, for the whole part and for each region, and their origin.

    Attributes
    ----------
    hits_at_border
        Straight rays of the outermost pixels that hit the part; more than 0 if it reaches beyond
        the picture.
    triangles_in_view
        Triangles of shells that the rays crossed, if the image states it.
    time_s
        Seconds of each stage in `TIMES`; None for those not measured. `with_time` adds the stages
        after the reduction.
    wavelength_nm
        Wavelength, nm, if the image states it.
    camera
        Camera and pose.
    assumptions
        Assumptions behind the numbers, in words.
    regions
        Numbers of each region of the part.
    full_resolution
        Pixels of the camera before the picture was scaled, if the image states it.
    engine_test
        Result of the check of the shells, plain values; None if there was none.
    aperture
        Bias and blur by a lens's aperture, plain values of
        `iriftrace.tracing.aperture.ApertureEffect`; None if they were not computed.
    """

    hits_at_border: int
    triangles_in_view: int | None
    time_s: Mapping[str, float | None]
    wavelength_nm: float | None
    camera: Camera
    assumptions: JsonObject
    regions: dict[str, ViewMetrics]
    full_resolution: tuple[int, int] | None = None
    engine_test: JsonObject | None = None
    aperture: JsonObject | None = None

    @property
    def full_camera(self) -> JsonObject | None:
        """Shifts and resolutions for all pixels of the camera; None if the picture has all.

        With more pixels a shift is as many times larger in pixels, and the step to the next pixel
        as many times smaller, except for edges that few pixels pass over.
        """
        width = self.camera.resolution[0]
        if self.full_resolution is None or self.full_resolution[0] == width:
            return None
        factor = self.full_resolution[0] / width
        shift = {k: v for k, v in asdict(self.shift_px).items() if k != "rms"}
        steps = {key: getattr(self, key) for key in _STEPS}
        return {
            "resolution": list(self.full_resolution),
            "shift_px": {k: None if v is None else v * factor for k, v in shift.items()},
            **{key: None if step is None else step / factor for key, step in steps.items()},
        }

    def with_time(self, stage: str, seconds: float) -> PoseMetrics:
        """The same metrics with the time of a stage after the reduction, also in the total."""
        total = (self.time_s["total"] or 0.0) + seconds
        return evolve(self, time_s={**self.time_s, stage: seconds, "total": total})

    def as_dict(self) -> JsonObject:
        """Plain JSON values of schema `SCHEMA`."""
        whole = super().as_dict()
        whole["rays"] = {"launched": self.rays.launched, **whole["rays"]}
        whole["rays"]["open_boundary"] = self.rays.open_boundary
        known = {"engine_test": self.engine_test, "aperture": self.aperture}
        return {
            "schema": SCHEMA,
            **whole,
            **({} if self.full_camera is None else {"full_camera": self.full_camera}),
            "hits_at_border": self.hits_at_border,
            "triangles_in_view": self.triangles_in_view,
            "time_s": dict(self.time_s),
            "wavelength_nm": self.wavelength_nm,
            "camera": self.camera.as_dict(),
            "pose": {
                "origin_mm": self.camera.origin.tolist(),
                "matrix": self.camera.matrix.tolist(),
            },
            "assumptions": dict(self.assumptions),
            "regions": {name: view.as_dict() for name, view in self.regions.items()},
            **{key: values for key, values in known.items() if values is not None},
        }


def pose_metrics(
    image: AovImage,
    part: Part,
    *,
    include: Collection[int] = (Status.GOOD,),
) -> PoseMetrics:
    """Reduce the image of one pose to metrics.

    Parameters
    ----------
    image
        AOV image of the pose.
    part
        The part in the image.
    include
        Status codes of the rays that count; 0 and 5 are possible.

    Raises
    ------
    InputError
        The image shows another part, or `include` names rays without a displacement.

    Warns
    -----
    IriftraceWarning
        The part's file changed since the rendering, or its faces are too small for the rays.
    """
    status = np.rint(image.channels["status.code"].ravel()).astype(np.uint8)
    face_plus_one = image.channels["part.face"].ravel()
    hits = np.flatnonzero(face_plus_one > 0)
    hit_face = np.rint(face_plus_one[hits]).astype(np.int64) - 1
    _check_part(image, part, hit_face)
    rays = rays_that_count(image, include)
    coverage = pose_coverage(part, rays, places_seen(image, part, include))
    _check_sampling(len(rays.face), coverage.visible_faces)
    values = _values(image, part, rays) if len(rays.face) >= FEWEST_RAYS else None

    def view(members: IntArray, own_hits: IntArray, regions: slice) -> JsonObject:
        numbers = {} if values is None or len(members) < FEWEST_RAYS else _numbers(values, members)
        if numbers:
            numbers |= _covered(coverage, regions)
        if image.is_ensemble:
            numbers["ensemble"] = ensemble_metrics(image, rays.pixels[members], own_hits)
        return numbers

    def of_region(number: int) -> ViewMetrics:
        chosen = part.region_of_face[hit_face] == number
        members = np.flatnonzero(part.region_of_face[rays.face] == number)
        return ViewMetrics(
            rays=RayCounts(hit=int(chosen.sum()), **_by_status(status[hits][chosen])),
            **view(members, hits[chosen], slice(number, number + 1)),
        )

    counts = image.header.get("counts") or {}
    times = image.header.get("time_s") or {}
    included = [status.key for status in Status if status in include]
    full = image.header.get("full_resolution")
    outermost = image.channels["part.face"] > 0
    outermost[1:-1, 1:-1] = False
    return PoseMetrics(
        rays=RayCounts(
            hit=len(hits),
            **_by_status(status),
            launched=int(status.size),
            open_boundary=counts.get("open_boundary"),
        ),
        **view(np.arange(len(rays.face)), hits, slice(None)),
        hits_at_border=int(outermost.sum()),
        triangles_in_view=counts.get("triangles_in_view"),
        time_s={key: times.get(key) for key in TIMES},
        wavelength_nm=image.header.get("wavelength_nm"),
        camera=image.camera,
        assumptions={**(image.header.get("assumptions") or {}), "included_rays": included},
        regions={name: of_region(number) for number, name in enumerate(part.region_names)},
        full_resolution=None if full is None else (int(full[0]), int(full[1])),
    )


def write_metrics(path: str | Path, metrics: PoseMetrics) -> None:
    """Write metrics as JSON; an existing file is replaced when the new one is complete.

    Raises
    ------
    InputError
        The folder does not exist, or a value is not plain JSON.
    """
    write_json(path, metrics.as_dict())


def _values(image: AovImage, part: Part, rays: PoseRays) -> dict[str, FloatArray]:
    """Values of each ray that counts, (n,) arrays, by the names of the metrics."""
    points, group = rays.position.T, part.smooth_group[rays.face]
    lateral, axial = step_spacing(points, rays.pixels, image.resolution, group)
    return bending(image, rays) | {
        "incidence_angle_deg": np.degrees(rays.incidence),
        "lateral_resolution_mm": lateral,
        "axial_resolution_mm": axial,
    }


def _numbers(values: dict[str, FloatArray], members: IntArray) -> JsonObject:
    """Metrics of some of the rays."""
    return {
        key: (Statistics.of if key in ("displacement_mm", "shift_px") else _mean)(column[members])
        for key, column in values.items()
    }


def _mean(values: FloatArray) -> float | None:
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else None


def _covered(coverage: Coverage, regions: slice) -> dict[str, float]:
    total = float(coverage.total[regions].sum())
    if total == 0:
        return {}
    return {
        "coverage_area": float(coverage.areas[regions].sum()) / total,
        "coverage": float(coverage.faces[regions].sum()) / total,
    }


def _by_status(status: NDArray[np.uint8]) -> dict[str, int]:
    counts = np.bincount(status, minlength=len(Status))
    return {code.key: int(counts[code]) for code in Status}


def _check_part(image: AovImage, part: Part, hit_face: IntArray) -> None:
    highest = int(hit_face.max(initial=-1))
    if highest >= len(part.faces):
        raise InputError(
            f"the image shows face {highest}, but {part.path} has only {len(part.faces)} faces; "
            "give the part with which the image was rendered.",
            code="picture.other_part",
            argument="part",
        )
    expected = (image.header.get("part") or {}).get("sha256")
    if expected is not None and expected != part.sha256:
        warn(
            f"{part.path} is not the file with which the image was rendered (its SHA-256 differs), "
            "so coverage and regions may be wrong.",
            argument="part",
        )


def _check_sampling(rays: int, faces: int) -> None:
    if faces and rays < _RAYS_PER_FACE * faces:
        warn(
            f"fewer than {_RAYS_PER_FACE:g} rays fall on each visible face of the part, so "
            "`coverage` depends on the tessellation; use `coverage_area` or more rays."
        )

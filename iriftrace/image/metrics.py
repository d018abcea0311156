"""Reduce the AOV image of one pose to the numbers by which poses are compared."""

from __future__ import annotations

import json
import warnings
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.core.files import whole_file
from iriftrace.image.aov_image import MEMBERS_CHANNEL, AovImage, Status
from iriftrace.image.coverage import Coverage, pose_coverage
from iriftrace.image.rays import Bending, PoseRays, bending, rays_that_count
from iriftrace.image.resolution import (
    Spacing,
    nearest_in_plane,
    nearest_in_space,
    pixel_grid,
    step_spacing,
)
from iriftrace.part.part import Part

# MERGE ray_statistics: Numbers that stand for those of many rays, and from how many on they may.

FEWEST_RAYS = 100
"""A metric of fewer good rays is null, and a pose with fewer of them counts as empty."""

STATISTICS = ("mean", "median", "p95", "max")
"""Keys of `statistics`."""


def statistics(values: NDArray[np.float64]) -> dict[str, float]:
    """Mean, median, 95th percentile and largest of some values, (n,) array with n > 0.

    A few silhouette rays jump by millimetres and rule the mean, so the median stands beside it.
    """
    median, p95 = np.percentile(values, (50, 95))
    return {
        "mean": float(values.mean()),
        "median": float(median),
        "p95": float(p95),
        "max": float(values.max()),
    }


def root_mean_square(values: NDArray[np.float64]) -> float:
    """Root of the mean square of some values, (n,) array with n > 0."""
    return float(np.sqrt(np.mean(values**2)))


# MERGE ensemble.metrics: Numbers of one pose that only an ensemble has: bias, scatter, and how ma


def has_ensemble(image: AovImage) -> bool:
    """Whether an image holds the mean and the scatter of several fields."""
    return MEMBERS_CHANNEL in image.channels


def ensemble_metrics(
    image: AovImage, pixels: IntArray, hits: IntArray, bias: dict[str, Any]
) -> dict[str, Any]:
    """Bias and scatter of some pixels.

    Parameters
    ----------
    image : AovImage
        With the channels of an ensemble.
    pixels : (n,) array
        Row-major numbers of the pixels whose rays count.
    hits : (m,) array
        Those of all pixels on the part.
    bias : dict
        ``displacement_mm`` and ``shift_px`` of the same pixels; of an ensemble's image they are
        those of the mean.

    Returns
    -------
    dict
        ``members``; ``bias_mm`` and ``bias_px``, statistics over the pixels of the mean, which can
        be corrected; ``scatter_mm`` and ``scatter_px``, statistics over the pixels of the standard
        deviation, which cannot; ``rays_in_all`` and ``rays_in_some``, pixels that count in all and
        only in some of the members. Statistics of fewer than 100 pixels are None.
    """
    members = int((image.header.get("ensemble") or {}).get("count") or 0)
    counted = np.rint(image.channels[MEMBERS_CHANNEL].ravel()[hits]).astype(np.int64)
    members = members or int(counted.max(initial=0))
    shift = [image.channels[f"shift.px.std.{a}"].ravel()[pixels].astype(np.float64) for a in "XY"]
    return {
        "members": members,
        "bias_mm": bias["displacement_mm"],
        "scatter_mm": _statistics(image.channels["displacement.std.norm"].ravel()[pixels]),
        "bias_px": bias["shift_px"],
        "scatter_px": _statistics(np.hypot(*shift)),
        "rays_in_all": int(np.count_nonzero(counted == members)),
        "rays_in_some": int(np.count_nonzero((counted > 0) & (counted < members))),
    }


def _statistics(values: NDArray[Any]) -> dict[str, float | None]:
    if len(values) < FEWEST_RAYS:
        return dict.fromkeys((*STATISTICS, "rms"))
    exact = values.astype(np.float64)
    return {**statistics(exact), "rms": root_mean_square(exact)}


SCHEMA = "iriftrace.pose/1"
"""Value of ``schema`` in the metrics."""

TIMES = ("load", "build", "straight", "refracted", "metrics", "write", "figures", "total")
"""Keys of ``time_s``."""

_RAYS_PER_FACE = 4


@frozen(eq=False)
class _Values:
    """What metrics need of each good ray, (n,) arrays in the order of the pixels."""

    bending: Bending
    incidence: FloatArray
    step: Spacing
    space: Spacing | None
    plane: Spacing | None


def pose_metrics(
    image: AovImage,
    part: Part,
    *,
    include: Collection[int] = (Status.GOOD,),
    nearest: bool = True,
) -> dict[str, Any]:
    """Metrics of one pose, ready for JSON.

    Parameters
    ----------
    image
        AOV image of the pose.
    part
        The part that the image shows.
    include
        Status codes of the rays that count; 0 and 5 are possible.
    nearest
        Whether to search nearest neighbours for the resolutions ``*_nn3d`` and ``*_nnxy``, which
        takes longer than all the rest; without, they are None.

    Returns
    -------
    dict
        Schema `SCHEMA`. Lengths in mm, angles in degrees, shifts in pixels, coverages from 0 to 1.
        ``displacement_lateral_mm`` and ``displacement_axial_mm`` are the means of the lengths
        across and along the line of sight. ``regions`` holds the same numbers for each region of
        the part, with ``rays`` counted by the region that the straight ray hits. Numbers that rest
        on fewer than 100 good rays are None. The image of an ensemble gives the key ``ensemble``
        too; see `iriftrace.image.metrics.ensemble_metrics`.

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
    camera = Camera.from_dict(image.header["camera"])
    rays = rays_that_count(image, camera, include)
    count = len(rays.face)
    coverage = pose_coverage(part, camera, rays)
    _check_sampling(count, coverage.visible_faces)

    values = _values(image, part, camera, rays, nearest) if count >= FEWEST_RAYS else None
    region_of_ray = part.region_of_face[rays.face]
    region_of_hit = part.region_of_face[hit_face]
    status_of_hit = status[hits]
    everything = slice(None)
    counts = image.header.get("counts") or {}
    times = image.header.get("time_s") or {}
    included = [Status(code).key for code in sorted(include)]
    whole = _numbers(values, everything, count)
    return {
        "schema": SCHEMA,
        "rays": {
            "launched": int(status.size),
            "hit": len(hits),
            **_by_status(status),
            "open_boundary": counts.get("open_boundary"),
        },
        **whole,
        **_covered(coverage, everything, count),
        **_ensemble(image, rays.pixels, hits, whole),
        "shell_triangles_in_view": counts.get("shell_triangles_in_view"),
        "time_s": {key: times.get(key) for key in TIMES},
        "wavelength_nm": image.header.get("wavelength_nm"),
        "camera": image.header["camera"],
        "pose": image.header.get("pose"),
        "assumptions": {**(image.header.get("assumptions") or {}), "included_rays": included},
        "regions": {
            name: {
                "rays": {
                    "hit": int(np.count_nonzero(region_of_hit == i)),
                    **_by_status(status_of_hit[region_of_hit == i]),
                },
                **(
                    numbers := _numbers(
                        values, members := np.flatnonzero(region_of_ray == i), len(members)
                    )
                ),
                **_covered(coverage, slice(i, i + 1), len(members)),
                **_ensemble(image, rays.pixels[members], hits[region_of_hit == i], numbers),
            }
            for i, name in enumerate(part.region_names)
        },
    }


def _ensemble(
    image: AovImage, pixels: IntArray, hits: IntArray, numbers: dict[str, Any]
) -> dict[str, Any]:
    """What only the image of several fields has."""
    if not has_ensemble(image):
        return {}
    return {"ensemble": ensemble_metrics(image, pixels, hits, numbers)}


def write_metrics(path: str | Path, metrics: dict[str, Any]) -> None:
    """Write metrics as JSON; an existing file is replaced when the new one is complete.

    Raises
    ------
    InputError
        The folder does not exist, or a value is not plain JSON.
    """
    try:
        text = json.dumps(metrics, indent=2, allow_nan=False, ensure_ascii=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"the metrics for {path} are not plain JSON: {error}.") from error
    with whole_file(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def _values(image: AovImage, part: Part, camera: Camera, rays: PoseRays, nearest: bool) -> _Values:
    points = rays.position.T
    grid = pixel_grid(rays.pixels, camera.resolution)
    # The search in the plane takes as long as all the rest; SciPy lets go of Python meanwhile.
    with ThreadPoolExecutor(max_workers=1) as pool:
        plane = pool.submit(nearest_in_plane, points, grid, camera) if nearest else None
        return _Values(
            bending=bending(image, camera, rays),
            incidence=np.degrees(rays.incidence),
            step=step_spacing(points, grid, part.smooth_group[rays.face]),
            space=nearest_in_space(points, grid, camera).spacing(points) if nearest else None,
            plane=None if plane is None else plane.result().spacing(points),
        )


def _numbers(values: _Values | None, members: IntArray | slice, count: int) -> dict[str, Any]:
    """Metrics of some of the rays; all None when they are too few."""
    if values is None or count < FEWEST_RAYS:
        return {
            "displacement_mm": dict.fromkeys((*STATISTICS, "rms")),
            "displacement_lateral_mm": None,
            "displacement_axial_mm": None,
            "shift_px": dict.fromkeys(STATISTICS),
            **dict.fromkeys(
                f"{direction}_resolution_mm{reading}"
                for reading in ("", "_nn3d", "_nnxy")
                for direction in ("lateral", "axial")
            ),
            "incidence_angle_deg": None,
        }
    norm = values.bending.norm[members]
    return {
        "displacement_mm": {**statistics(norm), "rms": root_mean_square(norm)},
        "displacement_lateral_mm": float(values.bending.lateral[members].mean()),
        "displacement_axial_mm": float(values.bending.axial[members].mean()),
        "shift_px": statistics(values.bending.shift[members]),
        **_resolution(values.step, members, ""),
        **_resolution(values.space, members, "_nn3d"),
        **_resolution(values.plane, members, "_nnxy"),
        "incidence_angle_deg": float(values.incidence[members].mean()),
    }


def _resolution(spacing: Spacing | None, members: IntArray | slice, reading: str) -> dict[str, Any]:
    if spacing is None:
        return {f"{direction}_resolution_mm{reading}": None for direction in ("lateral", "axial")}
    lateral, axial = spacing.lateral[members], spacing.axial[members]
    known = np.isfinite(lateral)
    some = bool(known.any())
    return {
        f"lateral_resolution_mm{reading}": float(lateral[known].mean()) if some else None,
        f"axial_resolution_mm{reading}": float(axial[known].mean()) if some else None,
    }


def _covered(coverage: Coverage, regions: slice, rays: int) -> dict[str, float | None]:
    total = float(coverage.total[regions].sum())
    if rays < FEWEST_RAYS or total == 0:
        return {"coverage": None, "coverage_area": None}
    return {
        "coverage": float(coverage.faces[regions].sum()) / total,
        "coverage_area": float(coverage.footprints[regions].sum()) / total,
    }


def _by_status(status: NDArray[np.uint8]) -> dict[str, int]:
    counts = np.bincount(status, minlength=len(Status))
    return {code.key: int(counts[code]) for code in Status}


def _check_part(image: AovImage, part: Part, hit_face: IntArray) -> None:
    highest = int(hit_face.max(initial=-1))
    if highest >= len(part.faces):
        raise InputError(
            f"the image shows face {highest}, but {part.path} has only {len(part.faces)} faces; "
            "give the part with which the image was rendered."
        )
    expected = (image.header.get("part") or {}).get("sha256")
    if expected is not None and expected != part.sha256:
        warnings.warn(
            f"{part.path} is not the file with which the image was rendered (its SHA-256 differs), "
            "so coverage and regions may be wrong.",
            IriftraceWarning,
            stacklevel=3,
        )


def _check_sampling(rays: int, faces: int) -> None:
    if faces and rays < _RAYS_PER_FACE * faces:
        warnings.warn(
            f"only {rays / faces:.1f} rays fall on each visible face of the part, so `coverage` "
            "depends on the tessellation; use `coverage_area` or more rays.",
            IriftraceWarning,
            stacklevel=3,
        )

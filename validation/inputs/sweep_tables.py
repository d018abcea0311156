"""Sweeps as tables typed by hand: what the planning tests rank."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from iriftrace.camera.pose_set import PoseSet
from iriftrace.image.aov_image import Status
from iriftrace.sweep.measures import metric_variables
from iriftrace.sweep.store import pose_variables, to_dataset


def sweep_table(
    displacement: Sequence[float],
    coverage: Sequence[float],
    axial: Sequence[float],
    lateral: Sequence[float],
    rays_good: Sequence[int] | int = 1000,
    poses: PoseSet | None = None,
) -> xr.Dataset:
    """A sweep with one region, ``part``, and a face that no pose sees.

    All statistics are alike, other readings unknown (NaN), other counts of rays 0. Poses aim at
    the origin.
    """
    count = len(displacement)
    known = {
        **dict.fromkeys(("displacement_mean", "displacement_median"), displacement),
        "displacement_p95": displacement,
        **dict.fromkeys(("coverage", "coverage_area"), coverage),
        "axial_resolution": axial,
        "lateral_resolution": lateral,
        **{f"rays_{status.key}": 0 for status in Status},
        "rays_good": rays_good,
    }
    variables = metric_variables([{"metrics": None, "failure": ""}] * count, count, [])
    for name, values in known.items():
        variables[name][1][:, 0] = values
    texts = np.array([""] * count, dtype=object)
    places = PoseSet(np.tile(np.eye(4), (count, 1, 1))) if poses is None else poses
    table = to_dataset(
        {
            **variables,
            **pose_variables(places, (0.0, 0.0, 0.0)),
            "exr": ("pose", texts),
            "scene": ("pose", texts),
            "warned": ("pose", np.zeros(count, dtype="i1")),
            "triangles_in_view": ("pose", np.zeros(count, dtype=int)),
            **{name: ("pose", np.full(count, np.nan)) for name in ("focal_length", "stand_off")},
        },
        [],
        {},
    )
    return with_faces(table, [[]] * count, [1.0])


def two_regions(part: xr.Dataset, other: xr.Dataset, name: str) -> xr.Dataset:
    """The first table as ``part``, the second one as another region of the same poses."""
    regional = [key for key, values in part.items() if "region" in values.dims]
    joined = xr.concat([part[regional], other[regional].assign_coords(region=[name])], dim="region")
    return part.drop_dims("region").merge(joined)


Sighting = tuple[int, int, float, float]
"""Face, good rays, mean displacement (mm), smallest angle of incidence (degree)."""


def with_faces(
    table: xr.Dataset,
    sightings: Sequence[Sequence[Sighting]],
    areas: Sequence[float],
    regions: Sequence[int] | None = None,
) -> xr.Dataset:
    """The table with what each pose sees of each face (CF contiguous ragged arrays)."""
    rows = [row for pose in sightings for row in pose]
    faces, rays, displacement, incidence = (
        np.array([row[column] for row in rows], dtype=kind)
        for column, kind in enumerate(("i4", "i4", "f4", "f4"))
    )
    count = len(areas)
    seen = np.bincount(faces, minlength=count)
    moved = np.bincount(faces, rays * displacement, minlength=count)
    best = np.full(count, np.inf)
    np.minimum.at(best, faces, incidence)
    with np.errstate(invalid="ignore"):
        mean = moved / np.bincount(faces, rays, minlength=count)
    return table.drop_dims(("face", "sighting"), errors="ignore").assign(
        sightings=("pose", np.array([len(pose) for pose in sightings], dtype="i8")),
        sighting_face=("sighting", faces),
        sighting_rays=("sighting", rays),
        sighting_displacement=("sighting", displacement),
        sighting_incidence=("sighting", incidence),
        **{f"sighting_offset_{axis}": ("sighting", np.zeros(len(rows), "f4")) for axis in "xyz"},
        face_area=("face", np.asarray(areas, dtype=float)),
        face_region=("face", np.array([1] * count if regions is None else regions, dtype="i2")),
        face_times_seen=("face", seen.astype("i4")),
        face_displacement=("face", mean.astype("f4")),
        face_incidence=("face", np.where(seen > 0, best, np.nan).astype("f4")),
    )

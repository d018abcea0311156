"""Sweeps as tables typed by hand: what the planning tests rank."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from iriftrace.camera.orbit import Orbit, orbit_poses
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
        sighting_seen=("sighting", np.ones(len(rows), "f4")),
        sighting_rays=("sighting", rays),
        sighting_displacement=("sighting", displacement),
        sighting_incidence=("sighting", incidence),
        **{f"sighting_offset_{axis}": ("sighting", np.zeros(len(rows), "f4")) for axis in "xyz"},
        face_area=("face", np.asarray(areas, dtype=float)),
        face_region=("face", np.array([1] * count if regions is None else regions, dtype="i2")),
        face_seen=("face", (seen > 0).astype("f4")),
        face_times_seen=("face", seen.astype("i4")),
        face_displacement=("face", mean.astype("f4")),
        face_incidence=("face", np.where(seen > 0, best, np.nan).astype("f4")),
    )


ORBIT = Orbit((0.0, 0.0, 0.0), (200.0, 150.0, 150.0))
# 4 azimuths at 3 elevations, and one pose at each pole.
AZIMUTHS, ELEVATIONS = np.linspace(0, 90, 4), np.linspace(-90, 90, 5)
GRID = orbit_poses(ORBIT, AZIMUTHS, ELEVATIONS)
EMPTY = (0, 6)
"""Poses without numbers: the lower pole and one in the middle."""


def known_sweep(
    poses: PoseSet = GRID, empty: tuple[int, ...] = EMPTY, **attributes: Any
) -> xr.Dataset:
    """A sweep with known numbers: pose i has a displacement of 1.5**i um."""
    count = len(poses)
    number = np.arange(count)
    table = sweep_table(
        1e-3 * 1.5**number,
        0.1 + 0.3 * number / count,
        0.2 + 0.01 * np.cos(number),
        0.3 + 0.01 * np.sin(number),
        poses=poses,
    )
    counts = {status: 10 * (status + 1) * (number + 1) for status in Status}
    counts[Status.GOOD] = 1000 + number
    counts[Status.GAVE_UP] = 0 * number
    for status, rays in counts.items():
        rays[list(empty)] = -1
        table[f"rays_{status.key}"] = (("pose", "region"), rays[:, None])
    table["triangles_in_view"] = ("pose", np.where(counts[Status.GOOD] < 0, -1, 500 + number))
    for name, variable in table.items():
        if "region" in variable.dims and variable.dtype == np.float64:
            table[name][list(empty)] = np.nan
    table.attrs.update({key: json.dumps(value) for key, value in attributes.items()})
    return table

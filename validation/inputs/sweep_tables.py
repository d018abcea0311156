"""Sweeps as tables typed by hand: what the planning tests rank."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from iriftrace.planning.summary import summarise

METRIC_VARIABLES = [
    *(f"displacement_{statistic}" for statistic in ("mean", "median", "p95")),
    "coverage",
    *(
        f"{direction}_resolution{reading}"
        for direction in ("axial", "lateral")
        for reading in ("", "_nn3d", "_nnxy")
    ),
]


def sweep_table(
    displacement: Sequence[float],
    coverage: Sequence[float],
    axial: Sequence[float],
    lateral: Sequence[float],
    rays_good: Sequence[int] | int = 1000,
) -> xr.Dataset:
    """A sweep with one region, ``part``; all statistics alike, unnamed readings unknown (NaN)."""
    count = len(displacement)
    columns = {name: np.full(count, np.nan) for name in METRIC_VARIABLES}
    for statistic in ("mean", "median", "p95"):
        columns[f"displacement_{statistic}"] = np.asarray(displacement, dtype=float)
    columns["coverage"] = np.asarray(coverage, dtype=float)
    columns["axial_resolution"] = np.asarray(axial, dtype=float)
    columns["lateral_resolution"] = np.asarray(lateral, dtype=float)
    columns["rays_good"] = np.broadcast_to(np.asarray(rays_good, dtype=np.int64), (count,))
    return xr.Dataset(
        {
            **{name: (("pose", "region"), values[:, None]) for name, values in columns.items()},
            "failure": ("pose", np.array([""] * count, dtype=object)),
        },
        coords={"region": ["part"]},
    )


summary_of = summarise


def two_regions(part: xr.Dataset, other: xr.Dataset, name: str) -> xr.Dataset:
    """The first table as ``part``, the second one as another region of the same poses."""
    failure = part["failure"]
    joined = xr.concat(
        [part.drop_vars("failure"), other.drop_vars("failure").assign_coords(region=[name])],
        dim="region",
    )
    return joined.assign(failure=failure)


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
    return table.assign(
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

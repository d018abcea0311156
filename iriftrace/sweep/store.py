"""The result of a sweep: one labelled dataset, in memory and as a netCDF file.

The metrics of each pose are described in `iriftrace.sweep.measures`, the faces that each pose sees
in `iriftrace.image.sightings`.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from iriftrace.core.arrays import BoolArray, FloatArray, Variables
from iriftrace.core.engines import engine_named
from iriftrace.core.errors import InputError
from iriftrace.core.files import FileOrigin, sha256_of, whole_file
from iriftrace.core.plain import JsonObject
from iriftrace.image.sightings import COLUMNS, COUNTS, ROW, FaceSightings
from iriftrace.io.netcdf import json_attributes, read_netcdf
from iriftrace.sweep.journal import journal_of
from iriftrace.sweep.measures import MEASURES, OF_POSES, RAYS

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.camera.pose_set import PoseSet

SCHEMA = "iriftrace.sweep/3"
WHOLE_PART = "part"

CONVENTIONS = "CF-1.11"
"""Climate and Forecast conventions of the files: units, flags, ragged arrays."""

PLACE = (
    *("azimuth", "elevation", "distance", "origin_x", "origin_y", "origin_z"),
    *("focal_length", "stand_off", "scene"),
)
"""Coordinates of the poses."""

TABLE = "table"
"""Coordinate of the poses of a part on a turntable: its angle."""

_OF_TABLE = {"units": "degree", "long_name": "angle of the turned part"}

SIGHTING = "sighting"
"""Dimension of the rows of all poses."""

WARNED = "warned"
"""Variable over ``pose`` with the flags of `iriftrace.sweep.warned`."""

_OF_EVERY_SWEEP = (
    "region",
    *(*MEASURES, *RAYS, *OF_POSES, "failure", "matrix", "exr", WARNED, *PLACE),
    *(COUNTS, "face_area", "face_region", "face_seen", "face_times_seen"),
    *("face_displacement", "face_incidence"),
    *(f"{SIGHTING}_{name}" for name in COLUMNS),
)

_CHUNK = 65_536
# Higher levels make the files 1 to 3 % smaller and take several times as long.
_LEVEL = 4


def pose_variables(poses: PoseSet, target: ArrayLike) -> Variables:
    """Positions of the cameras as variables; ``distance`` is that to the target, mm, world.

    Poses without angles of an orbit have those of their line of sight; azimuths are 0 to 360.
    """
    azimuth, elevation = line_of_sight_angles(poses.matrices)
    given = np.remainder(poses.azimuth_deg, 360.0)
    table = poses.table_deg
    distance = np.linalg.norm(poses.origins - np.asarray(target, dtype=np.float64), axis=1)
    origins = {
        f"origin_{axis}": (
            ("pose",),
            places,
            {"units": "mm", "long_name": f"camera's {axis}, world"},
        )
        for axis, places in zip("xyz", poses.origins.T, strict=True)
    }
    return {
        "pose": (("pose",), np.arange(len(distance)), {"long_name": "number of the pose"}),
        **origins,
        "matrix": (
            ("pose", "row", "column"),
            poses.matrices,
            {"long_name": "camera to world; x right, y down, z forward", "units": "mm"},
        ),
        **{
            name: (("pose",), np.where(np.isfinite(orbit), orbit, seen), {"units": "degree"})
            for name, orbit, seen in (
                ("azimuth", given, azimuth),
                ("elevation", poses.elevation_deg, elevation),
            )
        },
        "distance": (("pose",), distance, {"units": "mm", "long_name": "camera to target"}),
        **({TABLE: (("pose",), table, _OF_TABLE)} if np.isfinite(table).any() else {}),
    }


def line_of_sight_angles(matrices: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Azimuth, 0 to 360, and elevation (n,), degree, from which cameras (n, 4, 4) look.

    Rounded to 0.001, so that straight down is azimuth 0 and not the angle of two rounding errors.
    """
    x, y, z = 0.0 - np.round(matrices[:, :3, 2], 9).T
    azimuth = np.round(np.degrees(np.arctan2(y, x)), 3)
    return np.remainder(azimuth, 360.0), np.round(np.degrees(np.arctan2(z, np.hypot(x, y))), 3)


def to_dataset(
    variables: Variables, region_names: Sequence[str], attributes: JsonObject
) -> xr.Dataset:
    """All variables as one dataset; attributes that are not numbers or strings become JSON.

    Variables that locate a pose become coordinates, so that poses can be selected by them.
    """
    import xarray as xr

    found = xr.Dataset(
        variables,
        coords={"region": np.array([WHOLE_PART, *region_names], dtype=object)},
        attrs={
            "Conventions": CONVENTIONS,
            "schema": SCHEMA,
            **json_attributes(attributes),
        },
    )
    return found.set_coords([name for name in (*PLACE, TABLE) if name in found])


def write_sweep(path: Path, dataset: xr.Dataset, sightings: Iterable[FaceSightings]) -> None:
    """Write a sweep as netCDF; an existing file is replaced when the new one is complete.

    The dataset has all variables except those over ``sighting``: the sightings of only one pose are
    in memory at a time. Raises InputError if the disk has no room, or the file cannot be written.
    """
    rows = int(dataset[COUNTS].sum())
    _refuse_full_disk(path, dataset.nbytes + rows * ROW.itemsize)
    with whole_file(path) as temporary:
        packed = {name: {"zlib": True} for name, v in dataset.items() if v.dims == ("face",)}
        dataset.to_netcdf(temporary, engine="h5netcdf", encoding=packed)
        _append_sightings(temporary, rows, sightings)


def _append_sightings(path: Path, rows: int, sightings: Iterable[FaceSightings]) -> None:
    """Add the variables over ``sighting`` to a netCDF file without them, pose by pose."""
    import h5netcdf

    with h5netcdf.File(path, "r+") as file:
        file.dimensions[SIGHTING] = rows
        columns = {}
        for name, (kind, unit, text) in COLUMNS.items():
            column = file.create_variable(
                f"{SIGHTING}_{name}",
                (SIGHTING,),
                np.dtype(kind),
                chunks=(min(_CHUNK, max(rows, 1)),),
                compression="gzip",
                compression_opts=_LEVEL,
                shuffle=True,
            )
            column.attrs.update(units=unit, long_name=text)
            columns[name] = column
        start = 0
        for found in filter(len, sightings):
            for name, column in columns.items():
                column[start : start + len(found)] = getattr(found, name)
            start += len(found)


def _refuse_full_disk(path: Path, needed: int) -> None:
    """Refuse to start on a disk without room: HDF5 ends the program if it gets full."""
    if not path.parent.is_dir():
        return
    free = shutil.disk_usage(path.parent).free
    if free < needed:
        raise InputError(
            f"{path} needs up to {needed / 1e6:.1f} MB and the disk has {free / 1e6:.1f} MB left; "
            "make room and give the same command again: no pose is lost.",
            code="disk.full",
        )


def read_sweep(path: str | Path) -> xr.Dataset:
    """Read a sweep that :func:`write_sweep` wrote.

    Variables over ``sighting`` stay in the file, which is open as long as the dataset exists, and
    are read on use: for a fine mesh they are large.

    Raises
    ------
    InputError
        If the file is missing, not netCDF, of another program, has no pose, or misses a variable.
    """
    file = Path(path)
    if file.suffix == ".xml" and file.is_file():
        raise InputError(
            f"{file} is a scene; give the file that `iriftrace sweep {file}` writes.",
            code="sweep.is_scene",
        )
    journal = journal_of(file)
    if journal.is_file() and not file.is_file():
        raise InputError(
            f"The sweep {file} is not finished, its finished poses are in {journal}; give the same "
            "`iriftrace sweep` command again, which continues from there.",
            code="sweep.unfinished",
        )
    dataset = read_netcdf(file, "sweep", SCHEMA, left_in_file=SIGHTING)
    try:
        check_sweep(dataset)
    except InputError:
        dataset.close()
        raise
    dataset.encoding["source"] = str(file.resolve())
    return dataset


def file_of(dataset: xr.Dataset) -> Path | None:
    """The file that a sweep was read from, absolute; None for a sweep in memory."""
    source = dataset.encoding.get("source")
    return None if source is None else Path(source)


def origin_of(dataset: xr.Dataset) -> FileOrigin | None:
    """The same with its SHA-256, for which the whole file is read; None if it is gone, too."""
    file = file_of(dataset)
    return FileOrigin.of(file) if file is not None and file.is_file() else None


def check_sweep(dataset: xr.Dataset) -> None:
    """Raise InputError unless a dataset has a pose, and the variables that every sweep has."""
    if dataset.sizes.get("pose") == 0:
        raise InputError(
            "The sweep has no poses, so there is nothing to rank; run it again.",
            code="sweep.no_pose",
        )
    missing = [name for name in _OF_EVERY_SWEEP if name not in dataset]
    if missing:
        raise InputError(
            f"This is not a sweep of iriftrace: {missing[0]} is missing; give the file that "
            "`iriftrace sweep` wrote.",
            code="sweep.missing_variable",
        )


def scene_of(dataset: xr.Dataset) -> tuple[Path | None, str]:
    """File of the scene that was swept and its SHA-256, from the attributes."""
    scene = attribute(dataset, "scene")
    return (Path(scene["path"]), str(scene.get("sha256"))) if scene.get("path") else (None, "")


def scene_of_pose(dataset: xr.Dataset, pose: int) -> JsonObject:
    """Scene of one pose: path, SHA-256, parameters; empty if the attributes do not state it."""
    try:
        scenes = json.loads(dataset.attrs.get("scenes", "[]"))
        name = str(dataset["scene"].values[pose])
    except (TypeError, ValueError, KeyError):
        return attribute(dataset, "scene")
    return next((s for s in scenes if s.get("scene") == name), attribute(dataset, "scene"))


def included(dataset: xr.Dataset) -> tuple[int, ...]:
    """Status codes of the rays that the metrics of a sweep use."""
    return tuple(json.loads(dataset.attrs.get("include", "[0]")))


def traced_through_cells(dataset: xr.Dataset) -> BoolArray:
    """Mask (n,) of the poses whose rays the field's cells bend."""
    names = dataset["scene"].values.astype(str)
    _, first, scene = np.unique(names, return_index=True, return_inverse=True)
    engines = [scene_of_pose(dataset, int(pose)).get("engine") for pose in first]
    cells = np.array([name is not None and engine_named(name).through_cells for name in engines])
    chosen: BoolArray = cells[scene] | (dataset["through_cells"].values == 1)
    return chosen


def check_unchanged(path: str | Path, sha256: str) -> None:
    """Raise InputError, half a sentence to be continued, if a file changed since the sweep."""
    file = Path(path)
    if not file.is_file():
        raise InputError(f"{file} is gone", code="file.missing")
    if sha256_of(file) != sha256:
        raise InputError(f"{file} has changed since the sweep", code="file.changed")


def attribute(dataset: xr.Dataset, name: str) -> JsonObject:
    """A compound attribute of a sweep; empty if it is missing or something else."""
    try:
        value = json.loads(dataset.attrs.get(name, ""))
    except (TypeError, ValueError):
        return {}
    return value if isinstance(value, dict) else {}

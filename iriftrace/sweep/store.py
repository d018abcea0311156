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

from iriftrace.core.arrays import BoolArray, Variables
from iriftrace.core.errors import InputError
from iriftrace.core.files import check_readable, sha256_of, whole_file
from iriftrace.core.netcdf import check_netcdf
from iriftrace.core.plain import JsonObject
from iriftrace.image.sightings import COLUMNS, COUNTS, ROW, FaceSightings
from iriftrace.sweep.journal import journal_of

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.camera.pose_set import PoseSet

SCHEMA = "iriftrace.sweep/2"
WHOLE_PART = "part"

CONVENTIONS = "CF-1.11"
"""Climate and Forecast conventions of the files: units, flags, ragged arrays."""

PLACE = (
    *("azimuth", "elevation", "distance", "origin_x", "origin_y", "origin_z"),
    *("focal_length", "stand_off", "scene"),
)
"""Coordinates of the poses."""

SIGHTING = "sighting"
"""Dimension of the rows of all poses."""

_CHUNK = 65_536
# Higher levels make the files 1 to 3 % smaller and take several times as long.
_LEVEL = 4


def pose_variables(poses: PoseSet, target: ArrayLike) -> Variables:
    """Positions of the cameras as variables; ``distance`` is that to the target, mm, world."""
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
        "azimuth": (("pose",), poses.azimuth_deg, {"units": "degree"}),
        "elevation": (("pose",), poses.elevation_deg, {"units": "degree"}),
        "distance": (("pose",), distance, {"units": "mm", "long_name": "camera to target"}),
    }


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
            **{
                key: value if isinstance(value, str | int | float) else json.dumps(value)
                for key, value in attributes.items()
            },
        },
    )
    return found.set_coords([name for name in PLACE if name in found])


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
            "make room and give the same command again: no pose is lost."
        )


def read_sweep(path: str | Path) -> xr.Dataset:
    """Read a sweep that :func:`write_sweep` wrote.

    Variables over ``sighting`` stay in the file, which is open as long as the dataset exists, and
    are read on use: for a fine mesh they are large.

    Raises
    ------
    InputError
        If the file is missing, not netCDF, of another program, or has no pose.
    """
    import xarray as xr

    if not Path(path).is_file():
        journal = journal_of(Path(path))
        if journal.is_file():
            raise InputError(
                f"The sweep {path} is not finished, its finished poses are in {journal}; give the "
                "same `iriftrace sweep` command again, which continues from there."
            )
        raise InputError(f"There is no sweep {path}; `iriftrace sweep` writes one.")
    check_readable(Path(path))
    if Path(path).suffix == ".xml":
        raise InputError(f"{path} is a scene; give the file that `iriftrace sweep {path}` writes.")
    check_netcdf(Path(path))
    try:
        dataset = xr.open_dataset(path, engine="h5netcdf")
        for variable in dataset.variables.values():
            if SIGHTING not in variable.dims:
                variable.load()
    except Exception as error:  # xarray decodes what a damaged file states, with any error
        raise InputError(
            f"{path} is damaged or not a netCDF file ({error}); give a sweep."
        ) from error
    schema = dataset.attrs.get("schema")
    if schema == SCHEMA and dataset.sizes.get("pose", 0):
        return dataset
    dataset.close()
    if schema == SCHEMA:
        raise InputError(f"{path} has no pose; run the sweep again.")
    raise InputError(
        f"{path} has schema {schema!r} instead of {SCHEMA!r}, so it is not a sweep of this version "
        "of iriftrace; run the sweep again."
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


def traced_through_cells(dataset: xr.Dataset) -> BoolArray:
    """Mask (n,) of the poses whose rays the field's cells bend."""
    count = dataset.sizes["pose"]
    names = dataset["scene"].values.astype(str) if "scene" in dataset else np.zeros(count)
    _, first, scene = np.unique(names, return_index=True, return_inverse=True)
    asked = [scene_of_pose(dataset, int(pose)).get("engine") == "cells" for pose in first]
    chosen = dataset["through_cells"].values == 1 if "through_cells" in dataset else False
    return np.array(asked)[scene] | chosen


def check_unchanged(path: str | Path, sha256: str) -> None:
    """Raise InputError, half a sentence to be continued, if a file changed since the sweep."""
    file = Path(path)
    if not file.is_file():
        raise InputError(f"{file} is gone")
    if sha256_of(file) != sha256:
        raise InputError(f"{file} has changed since the sweep")


def attribute(dataset: xr.Dataset, name: str) -> JsonObject:
    """A compound attribute of a sweep; empty if it is missing or something else."""
    try:
        value = json.loads(dataset.attrs.get(name, ""))
    except (TypeError, ValueError):
        return {}
    return value if isinstance(value, dict) else {}

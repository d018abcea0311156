"""The result of a sweep: one labelled dataset, in memory and as a netCDF file."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from iriftrace.errors import InputError
from iriftrace.face_sightings import COUNTS as COUNTS_OF_FACES
from iriftrace.face_sightings import ROW, FaceSightings
from iriftrace.sighting_file import SIGHTING, append_sightings
from iriftrace.status import Status
from iriftrace.whole_file import whole_file

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.pose_set import PoseSet

SCHEMA = "iriftrace.sweep/1"
WHOLE_PART = "part"

# Name in the file: (keys in the pose metrics, unit, description).
MEASURES: dict[str, tuple[tuple[str, ...], str, str]] = {
    **{
        f"displacement_{key}": (("displacement_mm", key), "mm", f"{text} displacement")
        for key, text in (
            ("mean", "mean"),
            ("median", "median"),
            ("p95", "95th percentile of the"),
            ("max", "largest"),
            ("rms", "root mean square"),
        )
    },
    "displacement_lateral": (("displacement_lateral_mm",), "mm", "mean across the line of sight"),
    "displacement_axial": (("displacement_axial_mm",), "mm", "mean along the line of sight"),
    **{
        f"shift_{key}": (("shift_px", key), "px", f"{key} shift in the picture")
        for key in ("mean", "median", "p95", "max")
    },
    **{
        f"{direction}_resolution{reading}": (
            (f"{direction}_resolution_mm{reading}",),
            "mm",
            f"{direction} resolution, {text}",
        )
        for direction in ("lateral", "axial")
        for reading, text in (
            ("", "step to the next pixel"),
            ("_nn3d", "nearest neighbour in space"),
            ("_nnxy", "nearest neighbour in the picture's plane"),
        )
    },
    "incidence_angle": (("incidence_angle_deg",), "degree", "mean angle of incidence"),
    "coverage": (("coverage",), "1", "area of the faces hit over the area"),
    "coverage_area": (("coverage_area",), "1", "area of the pixels' footprints over the area"),
}

# Of an ensemble only; the other displacements are then those of the members' mean.
ENSEMBLE_MEASURES: dict[str, tuple[tuple[str, ...], str, str]] = {
    f"scatter_{key}": (
        ("ensemble", "scatter_mm", key),
        "mm",
        f"{text} standard deviation of the displacement over the members",
    )
    for key, text in (
        ("mean", "mean"),
        ("median", "median"),
        ("p95", "95th percentile of the"),
        ("max", "largest"),
        ("rms", "root mean square"),
    )
}
ENSEMBLE_COUNTS = {
    "ensemble_members": (("ensemble", "members"), "members of the ensemble"),
    "rays_in_all": (("ensemble", "rays_in_all"), "rays that count in all members"),
    "rays_in_some": (("ensemble", "rays_in_some"), "rays that count in some members only"),
}
MEAN_OVER_MEMBERS = {"cell_methods": "realization: mean"}
SCATTER_OF_MEMBERS = {"cell_methods": "realization: standard_deviation"}
"""As the CF conventions (1.11, section 7.3) say it."""

COUNTS = ("hit", *(status.key for status in Status))
POSE_COUNTS = {
    "rays_launched": ("rays", "launched"),
    "rays_open_boundary": ("rays", "open_boundary"),
    "shell_triangles_in_view": ("shell_triangles_in_view",),
}
STAGES = ("straight", "refracted", "metrics", "total")


def metric_variables(
    entries: Iterable[dict[str, Any]],
    count: int,
    region_names: Sequence[str],
    *,
    ensemble: bool = False,
) -> dict[str, Any]:
    """What was measured in each pose, as variables of a dataset.

    Parameters
    ----------
    entries : iterable of dict
        For each pose ``metrics`` (as :func:`iriftrace.metrics.pose_metrics` gives them, or None)
        and ``failure``; only one is in memory at a time.
    count : int
        Number of poses.
    region_names : sequence of str
        Of the part; the whole part comes first as region ``"part"``.
    ensemble : bool
        Whether poses are those of several fields; adds their scatter.
    """
    shape = (count, 1 + len(region_names))
    wanted = {**MEASURES, **(ENSEMBLE_MEASURES if ensemble else {})}
    measures = {name: np.empty(shape) for name in wanted}
    counts = {f"rays_{key}": np.empty(shape, dtype=np.int64) for key in COUNTS}
    members = {name: np.empty(shape, dtype=np.int64) for name in ENSEMBLE_COUNTS if ensemble}
    pose_counts = {name: np.empty(count, dtype=np.int64) for name in POSE_COUNTS}
    times = {stage: np.empty(count) for stage in STAGES}
    failures = []
    for pose, entry in enumerate(entries):
        failures.append(entry["failure"])
        for region, view in enumerate(_views(entry["metrics"], region_names)):
            for name, (keys, _, _) in wanted.items():
                measures[name][pose, region] = _number(_at(view, keys))
            for key in COUNTS:
                counts[f"rays_{key}"][pose, region] = _count(_at(view, ("rays", key)))
            for name, values in members.items():
                values[pose, region] = _count(_at(view, ENSEMBLE_COUNTS[name][0]))
        for name, keys in POSE_COUNTS.items():
            pose_counts[name][pose] = _count(_at(entry["metrics"], keys))
        for stage in STAGES:
            times[stage][pose] = _number(_at(entry["metrics"], ("time_s", stage)))
    both = ("pose", "region")
    return {
        **{
            name: (
                both,
                measures[name],
                {"units": unit, "long_name": text, **_method(name, ensemble)},
            )
            for name, (_, unit, text) in wanted.items()
        },
        **{
            name: (both, values, {"units": "1", "long_name": ENSEMBLE_COUNTS[name][1]})
            for name, values in members.items()
        },
        **{name: (both, values, {"units": "1"}) for name, values in counts.items()},
        **{name: (("pose",), values, {"units": "1"}) for name, values in pose_counts.items()},
        **{f"time_{stage}": (("pose",), times[stage], {"units": "s"}) for stage in STAGES},
        "failure": (("pose",), np.array(failures, dtype=object)),
    }


def _method(name: str, ensemble: bool) -> dict[str, str]:
    """What was done over the members of an ensemble."""
    if not ensemble:
        return {}
    if name in ENSEMBLE_MEASURES:
        return SCATTER_OF_MEMBERS
    return MEAN_OVER_MEMBERS if name.startswith(("displacement_", "shift_")) else {}


def pose_variables(poses: PoseSet, target: ArrayLike) -> dict[str, Any]:
    """Where the camera stood, as variables of a dataset.

    Parameters
    ----------
    poses : PoseSet
    target : (3,) array, mm, world
        Point from which ``distance`` is measured.
    """
    distance = np.linalg.norm(poses.origins - np.asarray(target, dtype=np.float64), axis=1)
    return {
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
    variables: dict[str, Any], region_names: Sequence[str], attributes: dict[str, Any]
) -> xr.Dataset:
    """All variables as one dataset; attributes that are no numbers or strings become JSON."""
    import xarray as xr

    return xr.Dataset(
        variables,
        coords={"region": np.array([WHOLE_PART, *region_names], dtype=object)},
        attrs={"schema": SCHEMA, **{key: _attribute(v) for key, v in attributes.items()}},
    )


def write_sweep(path: Path, dataset: xr.Dataset, sightings: Iterable[FaceSightings]) -> None:
    """Write a sweep as netCDF; an existing file is replaced when the new one is complete.

    Parameters
    ----------
    path : Path
    dataset : xarray.Dataset
        All but the variables over ``sighting``.
    sightings : iterable of FaceSightings
        Of each pose; only one is in memory at a time.

    Raises
    ------
    InputError
        If the disk has no room for it, or the file cannot be written.
    """
    rows = int(dataset[COUNTS_OF_FACES].sum())
    _refuse_full_disk(path, dataset.nbytes + rows * ROW.itemsize)
    with whole_file(path) as temporary:
        packed = {name: {"zlib": True} for name, v in dataset.items() if v.dims == ("face",)}
        dataset.to_netcdf(temporary, engine="h5netcdf", encoding=packed)
        append_sightings(temporary, rows, sightings)


def _refuse_full_disk(path: Path, needed: int) -> None:
    """HDF5 ends the program when a disk gets full while it writes."""
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

    Variables over ``sighting`` stay in the file, which is open as long as the dataset is there, and
    are read where they are used: of a fine mesh they are large.

    Raises
    ------
    InputError
        If the file is missing, no netCDF, of another program, or holds no pose.
    """
    import xarray as xr

    if not Path(path).is_file():
        raise InputError(f"There is no sweep {path}; `iriftrace sweep` writes one.")
    try:
        dataset = xr.open_dataset(path, engine="h5netcdf")
        for variable in dataset.variables.values():
            if SIGHTING not in variable.dims:
                variable.load()
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path} is no netCDF file ({error}); give a sweep.") from error
    fault = _fault(dataset)
    if fault:
        dataset.close()
        raise InputError(f"{path} {fault}; run the sweep again.")
    return dataset


def _fault(dataset: xr.Dataset) -> str:
    if dataset.attrs.get("schema") != SCHEMA:
        return (
            f"has schema {dataset.attrs.get('schema')!r} instead of {SCHEMA!r}, so it is no "
            "sweep of this version of iriftrace"
        )
    return "" if dataset.sizes.get("pose", 0) else "holds no pose"


def _views(
    metrics: dict[str, Any] | None, region_names: Sequence[str]
) -> Iterator[dict[str, Any] | None]:
    yield metrics
    for name in region_names:
        yield None if metrics is None else metrics["regions"].get(name)


def _at(values: dict[str, Any] | None, keys: tuple[str, ...]) -> Any:
    for key in keys:
        if values is None:
            return None
        values = values.get(key)
    return values


def _number(value: Any) -> float:
    return float("nan") if value is None else float(value)


def _count(value: Any) -> int:
    return -1 if value is None else int(value)


def _attribute(value: Any) -> Any:
    return value if isinstance(value, str | int | float) else json.dumps(value)

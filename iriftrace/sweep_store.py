"""The results of a sweep on disk: a journal while it runs, one netCDF file when it is done."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from iriftrace.errors import InputError
from iriftrace.status import Status
from iriftrace.whole_file import whole_file

if TYPE_CHECKING:
    import xarray as xr

    from iriftrace.orbit import PoseSet

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

COUNTS = ("hit", *(status.key for status in Status))
POSE_COUNTS = {
    "rays_launched": ("rays", "launched"),
    "rays_open_boundary": ("rays", "open_boundary"),
    "shell_triangles_in_view": ("shell_triangles_in_view",),
}


class Journal:
    """One line of JSON per finished pose, after a line that says which sweep it is.

    Parameters
    ----------
    path : Path
        The file; it is made with the first pose.
    request : str
        Fingerprint of scene, poses and options; a journal of another sweep is refused.
    """

    def __init__(self, path: Path, request: str) -> None:
        self.path = path
        self._request = request
        self.done = self._read()

    def _read(self) -> dict[int, dict[str, Any]]:
        if not self.path.is_file():
            return {}
        lines = self.path.read_bytes().splitlines(keepends=True)
        # A line without its end was being written when the program was killed.
        whole = [line for line in lines if line.endswith(b"\n")]
        if not whole:
            return {}
        try:
            head = json.loads(whole[0])
            entries = [json.loads(line) for line in whole[1:]]
        except ValueError as error:
            raise InputError(
                f"{self.path} is damaged ({error}); delete it to start the sweep again."
            ) from error
        if head.get("request") != self._request:
            raise InputError(
                f"{self.path} belongs to a sweep of other poses, another scene or other options; "
                "delete it, or give another name with -o."
            )
        return {entry["pose"]: entry for entry in entries}

    def add(self, pose: int, entry: dict[str, Any]) -> None:
        """Record a pose so that it survives whatever happens next."""
        fresh = not self.done
        content = json.dumps({"pose": pose, **entry}) + "\n"
        if fresh:
            content = json.dumps({"schema": SCHEMA, "request": self._request}) + "\n" + content
        self._cut_unfinished()
        with self.path.open("wb" if fresh else "ab") as file:
            file.write(content.encode())
            file.flush()
            os.fsync(file.fileno())
        self.done[pose] = json.loads(content.splitlines()[-1])

    def _cut_unfinished(self) -> None:
        if not self.path.is_file():
            return
        with self.path.open("rb+") as file:
            content = file.read()
            whole = content.rfind(b"\n") + 1
            if whole < len(content):
                file.truncate(whole)


def fingerprint(*pieces: Any) -> str:
    """SHA-256 of values that tell one sweep from another."""
    text = json.dumps(pieces, sort_keys=True, default=lambda array: np.asarray(array).tolist())
    return hashlib.sha256(text.encode()).hexdigest()


def to_dataset(
    poses: PoseSet,
    entries: Sequence[dict[str, Any]],
    region_names: Sequence[str],
    target: np.ndarray[Any, Any],
    attributes: dict[str, Any],
) -> xr.Dataset:
    """All poses as one labelled dataset.

    Parameters
    ----------
    poses : PoseSet
    entries : sequence of dict
        For each pose ``metrics`` (as :func:`iriftrace.metrics.pose_metrics` gives them, or None),
        ``failure`` and ``exr``.
    region_names : sequence of str
        Of the part; the whole part comes first as region ``"part"``.
    target : (3,) array, mm, world
    attributes : dict
        Provenance; values that are no numbers or strings are stored as JSON.
    """
    import xarray as xr

    regions = [WHOLE_PART, *region_names]
    views = [list(_views(entry["metrics"], region_names)) for entry in entries]
    data: dict[str, Any] = {}
    for name, (keys, unit, text) in MEASURES.items():
        values = [[_number(_at(view, keys)) for view in row] for row in views]
        data[name] = (("pose", "region"), np.array(values), {"units": unit, "long_name": text})
    for key in COUNTS:
        counts = [[_count(_at(view, ("rays", key))) for view in row] for row in views]
        data[f"rays_{key}"] = (("pose", "region"), np.array(counts), {"units": "1"})
    for name, keys in POSE_COUNTS.items():
        counts_of_pose = [_count(_at(row[0], keys)) for row in views]
        data[name] = (("pose",), np.array(counts_of_pose), {"units": "1"})
    for stage in ("straight", "refracted", "metrics", "total"):
        seconds = [_number(_at(row[0], ("time_s", stage))) for row in views]
        data[f"time_{stage}"] = (("pose",), np.array(seconds), {"units": "s"})
    data["matrix"] = (
        ("pose", "row", "column"),
        poses.matrices,
        {"long_name": "camera to world; x right, y down, z forward", "units": "mm"},
    )
    data["azimuth"] = (("pose",), poses.azimuth_deg, {"units": "degree"})
    data["elevation"] = (("pose",), poses.elevation_deg, {"units": "degree"})
    distance = np.linalg.norm(poses.origins - target, axis=1)
    data["distance"] = (("pose",), distance, {"units": "mm", "long_name": "camera to target"})
    for name in ("failure", "exr"):
        data[name] = (("pose",), np.array([entry[name] for entry in entries], dtype=object))
    return xr.Dataset(
        data,
        coords={"region": np.array(regions, dtype=object)},
        attrs={"schema": SCHEMA, **{key: _attribute(v) for key, v in attributes.items()}},
    )


def write_sweep(path: Path, dataset: xr.Dataset) -> None:
    """Write a sweep as netCDF; an existing file is replaced when the new one is complete."""
    with whole_file(path) as temporary:
        dataset.to_netcdf(temporary, engine="h5netcdf")


def write_table(path: Path, dataset: xr.Dataset) -> None:
    """Write what is known of the whole part as CSV, one row a pose."""
    flat = dataset.sel(region=WHOLE_PART).drop_vars("region").drop_dims(("row", "column"))
    with whole_file(path) as temporary:
        flat.to_dataframe().to_csv(temporary)


def read_sweep(path: str | Path) -> xr.Dataset:
    """Read a sweep that :func:`write_sweep` wrote.

    Raises
    ------
    InputError
        If the file is missing, no netCDF, of another program, or holds no pose.
    """
    import xarray as xr

    if not Path(path).is_file():
        raise InputError(f"There is no sweep {path}; `iriftrace sweep` writes one.")
    try:
        with xr.open_dataset(path, engine="h5netcdf") as file:
            dataset = file.load()
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path} is no netCDF file ({error}); give a sweep.") from error
    if dataset.attrs.get("schema") != SCHEMA:
        raise InputError(
            f"{path} has schema {dataset.attrs.get('schema')!r} instead of {SCHEMA!r}, so it is no "
            "sweep of this version of iriftrace; run the sweep again."
        )
    if dataset.sizes.get("pose", 0) == 0:
        raise InputError(f"{path} holds no pose; run the sweep again.")
    return dataset


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

"""All imports of the package's rooms: who moves a module or renames an attribute edits this file.

The rest of the runner uses commands, public names, and inputs of `validation`. Imports are inside
the functions, so that one that fails makes the entries that need it missing, and no others.
"""

from __future__ import annotations

import json
from contextlib import redirect_stderr, redirect_stdout
from importlib.metadata import entry_points
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from values import REFUSED, Refused, digest, summary

import iriftrace


def command(*words: object) -> str:
    """What ``iriftrace`` prints; Refused with its message if it does not end well."""
    (program,) = entry_points(group="console_scripts", name="iriftrace")
    out, err = StringIO(), StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        status = program.load()([str(word) for word in words])
    if status:
        raise Refused(" ".join(err.getvalue().split())[-300:])
    return out.getvalue()


def refusal(error: Exception) -> dict[str, str] | None:
    """The entry of a refused input; None for other errors."""
    return {REFUSED: str(error)[:300]} if isinstance(error, iriftrace.IriftraceError) else None


def field_values(field: Any) -> dict[str, Any]:
    """Points, cells, n - 1."""
    return {
        "points": digest(np.asarray(field.grid.points, dtype=np.float64)),
        "corners": digest(np.asarray(field.grid.cell_connectivity, dtype=np.int64)),
        "kinds": digest(np.asarray(field.grid.celltypes, dtype=np.int64)),
        "refractivity": summary(field.refractivity),
        "length_unit": field.source.length_unit,
        "quantity": field.source.quantity,
    }


def shell_values(stack: Any) -> list[dict[str, Any]]:
    """Arrays and indices of each shell."""
    return [
        {
            **{name: getattr(shell, name) for name in ("layer", "refractivity", "ext", "int_")},
            **{
                name: None if (array := getattr(shell, name)) is None else digest(array)
                for name in ("vertices", "faces", "normals", "derivatives")
            },
        }
        for shell in stack.shells
    ]


def image_values(path: Path) -> dict[str, Any]:
    """Channels and header of an EXR."""
    image = iriftrace.read_exr(path)
    channels = {name: summary(values) for name, values in image.channels.items()}
    return {"channels": channels, "header": dict.fromkeys(map(str, image.header), "")}


def dataset_values(data: Any) -> dict[str, Any]:
    """Attributes and variables of a sweep or a study."""

    def attribute(value: Any) -> Any:
        said = isinstance(value, str) and value[:1] in ("{", "[")
        return json.loads(value) if said else value

    def filled(values: Any) -> Any:
        return values.astype(str) if values.dtype.kind in "OU" else values

    return {
        "attributes": {name: attribute(value) for name, value in data.attrs.items()},
        "variables": {
            str(name): {"dims": list(one.dims), "values": filled(one.values)}
            for name, one in data.variables.items()
        },
    }


def study_values(kind: str, *words: str) -> dict[str, Any]:
    """A study of the paper by its command, which moves to validation."""
    import xarray as xr

    command("study", kind, *words, "-o", f"{kind}.nc")
    with xr.open_dataset(f"{kind}.nc", engine="h5netcdf") as data:
        return dataset_values(data.load())


def part_regions(part: Any) -> dict[str, int]:
    """Number of faces of each region by its name."""
    names, of_face = part.region_names, part.region_of_face
    return {name: int((of_face == number).sum()) for number, name in enumerate(names)}


def calibration_values(found: Any) -> dict[str, Any]:
    """Intrinsics and lens, and the pose where there is one."""
    return {
        "focal_px": found.focal_px,
        "centre_px": found.centre_px,
        "resolution": found.resolution,
        "distortion": found.distortion.coefficients,
        "matrix": None if found.matrix is None else np.asarray(found.matrix),
        "views": found.views,
    }


def stereo_values(found: Any) -> dict[str, Any]:
    """Both cameras, and the second in the first one's frame."""
    return {
        "first": calibration_values(found.first),
        "second": calibration_values(found.second),
        "rotation": found.rotation,
        "translation_mm": found.translation_mm,
        "length_unit": found.length_unit,
    }


def pose_values(found: Any) -> dict[str, Any]:
    """Matrices and angles."""
    return {
        "matrices": found.matrices,
        "azimuth_deg": found.azimuth_deg,
        "elevation_deg": found.elevation_deg,
    }


def cloud_values(path: Path, **options: Any) -> dict[str, Any]:
    """Points, mm, unit and further columns of a cloud's file."""
    from iriftrace.io.clouds import read_cloud

    found = read_cloud(path, **options)
    return {
        "points": digest(np.asarray(found.points, dtype=np.float64)),
        "range": [found.points.min(axis=0).tolist(), found.points.max(axis=0).tolist()],
        "measured": digest(found.measured),
        "unit": found.unit,
        "columns": {name: summary(values) for name, values in found.columns.items()},
    }


def plan_values(found: Any) -> dict[str, Any]:
    """Ranking, metrics, and the set of views."""
    ranking, views = found.summary.plan, found.views
    return {
        "order": ranking.order,
        "score": ranking.score,
        "metrics": ranking.metrics,
        "normalised": ranking.normalised,
        "limits": ranking.limits,
        "unranked": sorted(ranking.unranked),
        "front": found.summary.front,
        "views": None
        if views is None
        else {name: getattr(views, name) for name in ("poses", "covered", "added", "coverable")},
    }


def pair_values(found: Any) -> dict[str, Any]:
    """Pairs with their errors, the best first."""
    names = ("pairs", "score", "error_mm", "bias_mm", "coverage", "angle_deg", "limits")
    return {name: getattr(found, name) for name in names}


def camera_values(camera: Any) -> dict[str, Any]:
    """A camera of a scene."""
    return {
        "matrix": camera.matrix,
        "focal_length_mm": camera.focal_length_mm,
        "sensor_mm": camera.sensor_mm,
        "resolution": camera.resolution,
        "focus_mm": camera.focus_mm,
    }

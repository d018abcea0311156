"""Hits on the part with their displacement, as points for ParaView and CloudCompare."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from iriftrace.core.arrays import FloatArray, as_float64
from iriftrace.image.aov_image import AovImage, FloatImage
from iriftrace.io.ply import write_ply_points
from iriftrace.io.refusals import check_ending
from iriftrace.io.vtk_write import write_vtk
from iriftrace.medium.origin import one_line
from iriftrace.part.part import Part

SUFFIXES = (".vtp", ".ply")

_UNITS = {
    "displacement": "mm",
    "shift.px": "px",
    "incidence.angle": "rad",
    "path.length": "mm",
    "path.error": "mm",
}
"""Unit by the start of a channel's name; channels without one are counts."""

_POINTS = ("straight.", "refracted.")
"""Channels that are the points: the straight hits, and these plus the displacement."""


def write_surface(path: str | Path, image: AovImage, part: Part) -> None:
    """Write the straight hits on the part as points, with the image's other channels.

    Points are float64: the line through the pixel's centre, cut with the plane of the face that it
    hits. Channels have the names and the float32 numbers of the EXR; in a .vtp, which supports
    vectors, ``displacement`` is one of X, Y and Z. Where there is no displacement it is 0 and
    ``status.code`` states why. Units and assumptions are field data of the .vtp and comments of the
    .ply.

    Parameters
    ----------
    path
        A .vtp or .ply; an existing file is replaced when the new one is complete.
    image
    part
        The part in the picture, in the world's frame.

    Raises
    ------
    InputError
        The file has another ending or cannot be written.
    """
    target = Path(path)
    check_ending(target, SUFFIXES, "a file of points on the part")
    pixels = np.flatnonzero(image.channels["part.face"])
    points = _straight_hits(image, part, pixels)
    columns = {
        name: channel.ravel()[pixels]
        for name, channel in image.channels.items()
        if not name.startswith(_POINTS)
    }
    remarks = ["x, y, z: mm", *(f"{name}: {_unit_of(name)}" for name in columns)]
    for key, value in image.header.get("assumptions", {}).items():
        remarks.append(f"{key.replace('_', ' ')}: {value}")
    if target.suffix.lower() == ".ply":
        write_ply_points(target, points, columns, comments=remarks)
    else:
        _write_vtp(target, points, columns, remarks)


def _straight_hits(image: AovImage, part: Part, pixels: np.ndarray) -> FloatArray:
    """(n, 3) points, mm, world, where lines of sight meet the planes of the faces they hit."""
    row, column = np.divmod(pixels, image.resolution[0])
    origin, direction = image.camera.rays(np.stack((column, row), axis=1))
    face = np.rint(image.channels["part.face"].ravel()[pixels]).astype(np.int64) - 1
    normal = part.face_normals[face]
    height = part.face_offsets[face] - np.einsum("ij,ij->i", normal, origin)
    length = height / np.einsum("ij,ij->i", normal, direction)
    return as_float64(origin + length[:, None] * direction)


def _unit_of(name: str) -> str:
    return next((unit for start, unit in _UNITS.items() if name.startswith(start)), "1")


def _write_vtp(
    path: Path, points: FloatArray, columns: dict[str, FloatImage], remarks: list[str]
) -> None:
    import pyvista as pv

    cloud = pv.PolyData(points)
    for name, values in columns.items():
        stem, _, axis = name.rpartition(".")
        vector = [f"{stem}.{one}" for one in "XYZ"]
        if not set(vector) <= columns.keys() or axis not in "XYZ":
            cloud.point_data[name] = values
        elif axis == "X":
            cloud.point_data[stem] = np.stack([columns[one] for one in vector], axis=1)
            array = cloud.GetPointData().GetAbstractArray(stem)
            for number, one in enumerate("XYZ"):
                array.SetComponentName(number, one)
    cloud.field_data["units and assumptions"] = [one_line(remark) for remark in remarks]
    write_vtk(path, cloud)

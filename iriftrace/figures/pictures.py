"""Descriptions of pictures in space: of scenes, results, fields and parts."""

from __future__ import annotations

from functools import singledispatch
from typing import Any

import numpy as np
import pyvista as pv
import xarray as xr
from attrs import evolve, frozen
from matplotlib import colormaps
from matplotlib.colors import to_hex

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject
from iriftrace.core.units import ZERO_CELSIUS_K, counted
from iriftrace.figures.describe import provenance_rows
from iriftrace.figures.picture import (
    BLOCKER_COLOUR,
    SECOND_COLOUR,
    SIGHT_COLOUR,
    UNKNOWN_COLOUR,
    Device,
    DrawnBody,
    Lines,
    SpacePicture,
    as_points,
    part_surface,
)
from iriftrace.figures.scan import MOST_POINTS
from iriftrace.figures.scene_picture import AIR_COLOUR_MAP, picture_of_scene
from iriftrace.figures.style import COLOUR_MAP, FAINT, SIGNED_COLOUR_MAP, ColourScale, number
from iriftrace.figures.sweep_picture import sweep_picture
from iriftrace.figures.sweep_space import towards_cameras
from iriftrace.image.aov_image import AovImage
from iriftrace.measuring.two_devices.correction import Correction
from iriftrace.measuring.two_devices.scan import Scan
from iriftrace.measuring.two_devices.sensitivity import EFFECT_COLUMN, MOST, Sensitivity
from iriftrace.measuring.two_devices.statistics import each_along
from iriftrace.medium.index_field import IndexField
from iriftrace.medium.source import stated_source, synthetic_mark
from iriftrace.part.part import Part
from iriftrace.sweep.faces import displacement_limits
from iriftrace.tracing.render import Rendering
from iriftrace.tracing.scene import Scene


@frozen
class CloudColumn:
    """A column of clouds by which points are coloured, or the length of a vector of this name."""

    name: str
    title: str
    unit: str = "µm"
    factor: float = 1e3
    u: str = ""  # column of its standard uncertainty

    @property
    def label(self) -> str:
        """Title and unit."""
        return f"{self.title} ({self.unit})"


ERROR = CloudColumn("error_normal", "error along the normal", u="scatter_normal")
DISPLACEMENT = CloudColumn("displacement", "displacement")
CORRECTION = CloudColumn("correction", "correction", u="u")
RESIDUAL = CloudColumn("residual", "residual of the fit at the dots", "px", 1.0)
EFFECT = CloudColumn(EFFECT_COLUMN, "diameter by 1 % of the excess temperature", "nm", 1.0)
COLUMNS = (ERROR, DISPLACEMENT, CORRECTION, RESIDUAL, EFFECT)


@singledispatch
def picture_of(shown: object, numbers: JsonObject | None = None) -> SpacePicture:
    """Describe the picture of a scene, a result, a field or a part.

    Parameters
    ----------
    shown
        What `iriftrace.view` shows.
    numbers
        JSON values that lie next to a cloud, such as part and devices.

    Raises
    ------
    InputError
        There is nothing to show, or files of the scene or sweep cannot be read.
    """
    raise InputError(
        f"An object of the type {type(shown).__name__} cannot be shown; give what load_scene, "
        "read_exr, read_sweep, read_field or read_part returns.",
        code="window.wrong_type",
    )


@picture_of.register
def _scene(scene: Scene, numbers: JsonObject | None = None) -> SpacePicture:
    return picture_of_scene(scene)


@picture_of.register
def _rendering(found: Rendering, numbers: JsonObject | None = None) -> SpacePicture:
    return _pose(found.image)


@picture_of.register
def _pose(image: AovImage, numbers: JsonObject | None = None) -> SpacePicture:
    from iriftrace.image.displacement import good_mask
    from iriftrace.io.exr import read_part_of

    part, good = read_part_of(image), good_mask(image)
    if not good.any():
        raise InputError(
            "The image has no good ray, so there is nothing to show.", code="picture.no_good_ray"
        )
    moved = image.vector("displacement", good)
    um = 1e3 * image.channels["displacement.norm"][good].astype(np.float64)
    several = image.is_ensemble
    u = 1e3 * image.channels["displacement.std.norm"][good].astype(np.float64) if several else None
    column = evolve(DISPLACEMENT, title="mean displacement") if several else DISPLACEMENT
    cloud = _cloud(image.vector("straight", good), um, column, u=u, moved=moved)
    return _measured("Displacement by hot air", part, [image.camera], cloud, image.header)


@picture_of.register
def _scan(scan: Scan, numbers: JsonObject | None = None) -> SpacePicture:
    um, scatter = 1e3 * scan.error_normal, scan.scatter_normal
    members: dict[str, FloatArray] = {}
    if scan.errors is not None and scatter is not None:
        along = 1e3 * each_along(scan.errors, scan.normal)
        members = {f"member {n}": each for n, each in zip(scan.numbers, along, strict=True)}
    u = None if scatter is None else 1e3 * scatter
    cloud = _cloud(scan.true, um, ERROR, u=u, moved=scan.error, members=members)
    title = f"Error of a {scan.system} measurement by hot air"
    devices = [scan.camera, scan.second]
    picture = _measured(title, _part_of(scan.provenance), devices, cloud, scan.provenance)
    return evolve(picture, members=tuple(members))


@picture_of.register
def _correction(found: Correction, numbers: JsonObject | None = None) -> SpacePicture:
    good = found.corrected
    um = 1e3 * np.linalg.norm(found.error[good], axis=1)
    u = None if found.u is None else 1e3 * found.u[good]
    cloud = _cloud(found.points[good], um, CORRECTION, u=u, moved=found.error[good])
    title = f"Correction of a {found.system} measurement"
    return _measured(title, _part_of(found.provenance), [], cloud, found.provenance)


@picture_of.register
def _sensitivity(found: Sensitivity, numbers: JsonObject | None = None) -> SpacePicture:
    cloud = pv.PolyData(found.cells.points.astype(np.float64))
    cloud.point_data[EFFECT_COLUMN] = found.effect_nm
    return _points(cloud, found.as_dict())


@picture_of.register
def _points(cloud: pv.PolyData, numbers: JsonObject | None = None) -> SpacePicture:
    """Points in the colours of the first known column, or of a vector's length."""
    columns = {name: np.asarray(cloud.point_data[name]) for name in cloud.point_data}
    known = {}
    for vector in ("error", "displacement", "correction"):
        for axes in ([f"{vector}_{axis}" for axis in "xyz"], [f"{vector}.{a}" for a in "XYZ"]):
            if set(axes) <= columns.keys():
                known[vector] = np.stack([columns[axis] for axis in axes], axis=1)
    known = {**known, **columns}
    column = next((one for one in COLUMNS if one.name in known), None)
    if column is None:
        raise InputError(
            f"The cloud has no column {', '.join(one.name for one in COLUMNS)}; give one of "
            "iriftrace measure, correct, render, fit or sensitivity.",
            code="cloud.no_vector",
        )
    values = known[column.name]
    scalar = values.ndim == 1
    values = column.factor * (values if scalar else np.linalg.norm(values, axis=1))
    # Nothing is known of points of another status, which does not mean 0.
    good = (columns.get("status", np.zeros(len(values))) == 0) & np.isfinite(values)
    if column is EFFECT:
        good &= np.abs(values) > FAINT * np.abs(values).max(initial=0.0)
    if not good.any():
        raise InputError(
            "The cloud has no point of status 0 with a value, so there is nothing to show.",
            code="cloud.no_point",
        )
    u = column.factor * columns[column.u][good] if column.u in columns else None
    points, moved = as_points(cloud)[good], known.get("error" if scalar else column.name)
    if moved is not None:
        moved = -moved[good] if column is CORRECTION else moved[good]
        points = points - moved if column is ERROR else points
    stated = numbers or {}
    size = 0.5 if column is EFFECT else 1.35
    shown = _cloud(points, values[good], column, u=u, moved=moved, size=size)
    listed = (stated.get("devices") or {}).items()
    devices = [Camera.from_dict(each) for _, each in listed]
    system = f" of a {stated['system']} measurement" if "system" in stated else ""
    heading = f"{column.title[0].upper()}{column.title[1:]}{system}"
    picture = _measured(heading, _part_of(stated), devices, shown, stated)
    if column is not EFFECT or "feature" not in stated:
        return picture
    title = f"Which air moves the diameter of {stated['feature']}"
    within = f"{100 * MOST:g} % of the effects within {stated['within_mm'][f'{MOST:g}']:.1f} mm of"
    return evolve(picture, title=title, subtitle=f"{within} the part; fainter points left out")


@picture_of.register
def _sweep(dataset: xr.Dataset, numbers: JsonObject | None = None) -> SpacePicture:
    return sweep_picture(dataset)


@picture_of.register
def _field(field: IndexField, numbers: JsonObject | None = None) -> SpacePicture:
    grid, name = field.grid.copy(deep=False), "air (°C)"
    grid.point_data[name] = field.temperature_k - ZERO_CELSIUS_K
    half = grid.clip(normal="y", origin=grid.center).extract_surface(algorithm="dataset_surface")
    half = half.triangulate()
    celsius = np.asarray(half.point_data[name], dtype=np.float64)
    limits = float(celsius.min()), float(celsius.max())
    scale = ColourScale(celsius, limits, name, False, AIR_COLOUR_MAP)
    surface = DrawnBody("air", as_points(half), half.regular_faces, scale=scale, values=celsius)
    outline = grid.outline()
    edges = [
        outline.points[ends].astype(np.float64) for ends in outline.lines.reshape(-1, 3)[:, 1:]
    ]
    low, high = (number(round(t)) for t in limits)
    return SpacePicture(
        title="Field of hot air, cut open",
        subtitle=f"{counted(grid.n_points, 'point')}, {low} to {high} °C",
        surfaces=(surface,),
        lines=(Lines("end of the data", edges, "#666666"),),
        facts=provenance_rows({}, field.source),
        mark=synthetic_mark(field.source) or "",
    )


@picture_of.register
def _part(part: Part, numbers: JsonObject | None = None) -> SpacePicture:
    from iriftrace.part.region_choice import placed_regions

    colours = colormaps["tab20"](np.arange(len(part.region_names)) % 20)
    surfaces = tuple(
        DrawnBody(name, *_used(part, part.region_of_face == place), to_hex(colours[place]))
        for place, name in enumerate(placed_regions(part))
    )
    size = " x ".join(number(round(float(extent), 3)) for extent in np.ptp(part.bounds, axis=0))
    subtitle = f"{counted(len(part.faces), 'face')}, {size} mm"
    return SpacePicture("Regions of the part", subtitle, surfaces)


def _used(part: Part, chosen: Any) -> tuple[FloatArray, Any]:
    """Vertices and faces of some of a part's faces."""
    used, faces = np.unique(part.faces[chosen], return_inverse=True)
    return part.vertices[used], faces.reshape(-1, 3)


def _cloud(points: FloatArray, values: FloatArray, column: CloudColumn, **more: Any) -> DrawnBody:
    """Points in colours up to the 99th percentile, in the scale of `plot`.

    It is about 0 for values with signs, else logarithmic.
    """
    values = np.asarray(values, dtype=np.float64)
    signed = bool((values < 0).any())
    most = float(np.nanpercentile(np.abs(values), 99)) or 1.0
    limits = (-most, most) if signed else displacement_limits(values)
    logarithmic = not signed and limits[0] > 0.0
    colours = SIGNED_COLOUR_MAP if signed else COLOUR_MAP
    scale = ColourScale(values, limits, column.label, logarithmic, colours)
    place = np.asarray(points, dtype=np.float64)
    none = np.empty((0, 3), dtype=np.int64)
    cloud = DrawnBody("points", place, none, UNKNOWN_COLOUR, scale, values, **more)
    return cloud.thinned(1 + (len(values) - 1) // MOST_POINTS)


def _measured(
    title: str,
    part: Part | None,
    cameras: list[Camera],
    cloud: DrawnBody,
    stated: JsonObject,
) -> SpacePicture:
    """Points on a part, with the devices that saw them."""
    source = stated_source(stated.get("field"))
    bodies = () if part is None else (part_surface(part, "part without a value", BLOCKER_COLOUR),)
    looks = (("camera", SIGHT_COLOUR), ("second device", SECOND_COLOUR))
    devices = (
        ()
        if part is None
        else tuple(
            Device(name, camera, part, colour, focus=False)
            for camera, (name, colour) in zip(cameras, looks, strict=False)
        )
    )
    middle = cloud.vertices.mean(axis=0)
    ahead = cameras[0].origin - middle if cameras else middle
    if part is not None and not cameras:
        # The side of the part on which the points lie.
        ahead = middle - part.centre
    towards = towards_cameras(ahead[None] if np.linalg.norm(ahead) > 1e-6 else np.ones((1, 3)))
    return SpacePicture(
        title=title,
        subtitle=_statistics(cloud),
        surfaces=(*bodies, cloud),
        devices=devices,
        towards=towards,
        hidden=tuple(device.name for device in devices),
        exaggerated="" if cloud.moved is None else "Displacement of the points",
        facts=provenance_rows(stated, source),
        mark=synthetic_mark(source) or "",
    )


def _part_of(stated: JsonObject) -> Part | None:
    """The part that JSON values state, if its file is still there."""
    from iriftrace.io.part_files import read_part
    from iriftrace.io.reading import ReadPart

    named = stated.get("part") or {}
    try:
        part = read_part(named["path"], ReadPart(length_unit=named["length_unit"]))
        return part.transformed(named["to_world"])
    except (KeyError, InputError):
        return None


def _statistics(cloud: DrawnBody) -> str:
    assert cloud.scale is not None
    values, unit = cloud.scale.values, cloud.scale.label.rpartition("(")[2].rstrip(")")
    low, middle, high = (number(float(f"{v:.3g}")) for v in np.percentile(values, (5, 50, 95)))
    drawn = f" ({len(cloud.vertices):,} drawn)" if cloud.every > 1 else ""
    spread = f"median {middle} {unit}, 5th to 95th percentile {low} to {high} {unit}"
    return f"{counted(len(values), 'point')}{drawn}, {spread}"

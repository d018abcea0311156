"""Simulate what two devices measure through hot air.

The camera's pixel sees X on the part along a refracted ray, and the second device sees or lights X
along another one. The sensor's software knows neither: it intersects the two straight lines of
sight of its calibration, and finds X'. The error is X' - X.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from attrs import asdict, evolve
from numpy.typing import NDArray

from iriftrace.camera.camera import Camera
from iriftrace.camera.tiles import pixels_in_tiles, within
from iriftrace.core.arrays import BoolArray, FloatArray, IntArray
from iriftrace.core.errors import InputError, warn, without_warnings
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.mesh.triangles import row_lengths
from iriftrace.image.aov_image import Status
from iriftrace.image.lost_rays import MOST, LostRay, as_rays
from iriftrace.measuring.options import Phase
from iriftrace.measuring.two_devices.devices import Sensor, provenance_of_two, sensor_of
from iriftrace.measuring.two_devices.scan import Scan, ScanStatus
from iriftrace.measuring.two_devices.statistics import completed
from iriftrace.measuring.two_devices.two_points import lines_of_sight
from iriftrace.part.part import Part
from iriftrace.tracing.engine import choose
from iriftrace.tracing.hot_air import FieldMember
from iriftrace.tracing.lost import warn_of_lost_points
from iriftrace.tracing.rays import traced_as_chosen
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.second_options import System

LEAST_ANGLE = math.radians(1.0)
"""Angle below which a warning is issued: the intersection moves 57 times as far as the lines."""

CLEAR_MM = 1e-3
"""Tolerated gap between a ray's end and the target point: what the miss allows at 0.06 degrees."""


def measure(
    scene: Scene,
    camera: Camera | None = None,
    second: Camera | None = None,
    *,
    system: System | None = None,
    phase: Phase | None = None,
    varied: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Scan:
    """Simulate a measurement with two devices in hot air.

    For an ensemble of fields the results are weighted means over its members, with their scatter.
    Points are those that are measured in the air of all members that count, whatever members
    without weight measure.

    The camera's pixels (for a laser, the rays of its sheet) are traced along their refracted rays
    to the part. `lines_of_sight` finds the other device's line of sight to each point. The measured
    point is where the straight lines meet:

    - ``stereo``: the midpoint between two cameras' lines.
    - ``fringe``: the camera's line meets the plane of the projector's column (``phase="columns"``)
      or row (``"rows"``) that lights the point; with ``"both"`` the midpoint between the lines.
    - ``laser``: the camera's line meets the sheet of light, which is the middle column of the
      second device.

    Parameters
    ----------
    scene : Scene
    camera, second : Camera, optional
        The scene's own two sensors by default.
    system : str, optional
        By default the id of the scene's second sensor decides: ``camera_2``, ``projector`` or
        ``laser``; stereo for other ids.
    phase : str, optional
        For fringe projection; by default columns or rows, those that run more across the direction
        from the projector to the camera.
    varied : bool
        Trace also members without weight: fields that were solved again with one input changed.
        Where such a member alone measures no point, its error is that of the field it varies, as if
        the input had no effect there.
    progress : callable, optional
        Called with the numbers of fields that are measured and of all.

    Raises
    ------
    InputError
        If there is no second device, both stand at one place, or they see nothing in common (for an
        ensemble: in the air of every member that counts).

    Warns
    -----
    IriftraceWarning
        Half of the lines meet at less than 1 degree, or as :func:`iriftrace.tracing.engine.choose`.
    """
    loaded, sensor = sensor_of(scene, camera, second, system, phase)
    started = time.perf_counter()
    found = measured(choose(loaded, *sensor.devices).scene, sensor, varied, progress)
    measure_s = time.perf_counter() - started
    compiled = loaded.compiled
    time_s = {"load": compiled.load_s, "build": compiled.build_s, "measure": measure_s}
    return evolve(found, time_s=time_s)


def measured(
    chosen: Scene,
    sensor: Sensor,
    varied: bool,
    progress: Callable[[int, int], None] | None = None,
) -> Scan:
    """What :func:`measure` finds by the engine of a scene, without its times."""
    if not chosen.members:
        return _scan(chosen, sensor)
    places = range(len(chosen.members)) if varied else chosen.counted
    members = [chosen.members[place] for place in places]
    scans: list[Scan | None] = []
    for listed, member in zip(members, chosen.alone(places), strict=True):
        if progress is not None:
            progress(len(scans), len(members))
        scans.append(_scan_of(listed, member, sensor))
    together = _together(scans, members, chosen.weights.of_places(places))
    return evolve(together, provenance=provenance_of_two(chosen, sensor.camera))


def _scan_of(listed: FieldMember, scene: Scene, sensor: Sensor) -> Scan | None:
    """What is measured in the air of a member; None if one that does not count measures nothing."""
    if listed.counts:
        return _scan(scene, sensor, listed.number)
    with without_warnings(), suppress(InputError):
        return _scan(scene, sensor)
    return None


def _together(
    scans: Sequence[Scan | None], members: Sequence[FieldMember], weights: MemberWeights
) -> Scan:
    """Weighted means of the points that are measured in the air of every member that counts."""
    pairs = zip(members, scans, strict=True)
    counted = [scan for one, scan in pairs if scan is not None and one.counts]
    status = np.max([scan.status for scan in counted], axis=0)
    kept = (status == ScanStatus.MEASURED).ravel()
    if not kept.any():
        raise InputError(
            "No point is measured in the air of every member of the ensemble; point both devices "
            "at the same side, or measure one member (member=1).",
            code="devices.nothing_common",
            argument="define",
        )
    measured = [
        np.zeros(len(kept), bool) if scan is None else scan.status.ravel() == ScanStatus.MEASURED
        for scan in scans
    ]
    known = np.array(measured)[:, kept]

    def each(name: str) -> FloatArray:
        """Values of the members, 0 where one does not measure a point."""
        values = np.zeros((*known.shape, *getattr(first, name).shape[1:]))
        for value, scan, there, by_pixel in zip(values, scans, known, measured, strict=True):
            if scan is not None:
                # Row by row of the picture, in the order of the points of each scan.
                value[there] = getattr(scan, name)[kept[by_pixel]]
        return values

    first = counted[0]
    rows = kept[(first.status == ScanStatus.MEASURED).ravel()]
    true = weights.mean(each("true"))
    errors = completed(dict(enumerate(zip(each("error"), known, strict=True))), members, weights)
    in_air = [scan.in_air[kept[scan.status.ravel() == ScanStatus.MEASURED]] for scan in counted]
    return evolve(
        first,
        points=true + weights.mean(errors),
        true=true,
        normal=first.normal[rows],
        gap=weights.mean(each("gap")),
        angle=weights.mean(each("angle")),
        pixel=first.pixel[rows],
        face=first.face[rows],
        in_air=np.all(in_air, axis=0),
        status=status,
        errors=errors,
        weights=weights,
        numbers=tuple(one.number for one in members),
        lost=tuple(ray for scan in counted for ray in scan.lost)[:MOST],
    )


def _scan(scene: Scene, sensor: Sensor, member: int | None = None) -> Scan:
    camera, sheet = sensor.camera, sensor.system == "laser"
    forward, solved = reversed(sensor.devices) if sheet else sensor.devices
    lit = _lit_points(scene, forward, sheet=sheet)
    codes, numbers, direction, in_air, unseen = _seen_by(scene, solved, forward, lit)
    status = lit.status
    status[lit.pixel] = codes
    missing = int((status == ScanStatus.LOST).sum())
    warn_of_lost_points(missing, len(lit.point) + lit.lost, "are left out")
    first, other = ("second", "camera") if sheet else ("camera", "second")
    lost = [evolve(ray, device=first, member=member) for ray in lit.lost_rays]
    lost += [evolve(ray, device=other, member=member) for ray in unseen]
    good = np.flatnonzero(codes[numbers] == ScanStatus.MEASURED)
    good = good[np.argsort(lit.pixel[numbers[good]])]
    kept = numbers[good]
    if len(kept) == 0:
        raise _nothing_in_common(lit.outcome, codes)
    lines = lit.direction[kept], direction[good]
    a, b = reversed(lines) if sheet else lines
    points, gap = sensor.triangulated(a, b)
    angle = np.arccos(np.clip(np.einsum("ij,ij->i", a, b), -1.0, 1.0))
    median = float(np.median(angle))
    if median < LEAST_ANGLE:
        warn(
            f"The lines of the two devices meet at {np.degrees(median):.2g} degrees (median), so "
            "that small errors of either become large in depth; set them farther apart."
        )
    return Scan(
        points=points,
        true=lit.point[kept],
        normal=lit.normal[kept],
        gap=gap,
        angle=angle,
        pixel=camera.project(camera.origin + a) if sheet else lit.place[kept],
        face=lit.face[kept],
        in_air=lit.in_air[kept] | in_air[good],
        status=status.reshape(lit.shape),
        **asdict(sensor, recurse=False),
        provenance=provenance_of_two(scene, camera),
        growth=scene.part.growth,
        lost=tuple(lost[:MOST]),
    )


class _Lit(NamedTuple):
    """Points of the part where the rays of the device that is traced forward end."""

    point: FloatArray  # (n, 3), mm
    normal: FloatArray  # (n, 3), of the part
    face: IntArray  # (n,)
    place: FloatArray  # (n, 2), px, where the ray starts in the picture
    direction: FloatArray  # (n, 3), of the ray at its start
    in_air: BoolArray  # (n,), the ray met hot air
    pixel: IntArray  # (n,) row-major number of its pixel
    outcome: IntArray  # `Status` of all rays that were traced
    lost: int  # number of rays that were lost
    lost_rays: list[LostRay]  # the first of them
    status: NDArray[np.int64]  # `ScanStatus` of all pixels that have no point
    shape: tuple[int, int]  # rows and columns


def _lit_points(scene: Scene, forward: Camera, *, sheet: bool) -> _Lit:
    """Trace the rays of a device; only those of the middle column if it sends a sheet of light."""
    pixels, number, shape = _pixels(forward, sheet=sheet)
    towards = _towards_part(forward, scene.part, pixels)
    status = np.full(len(towards), ScanStatus.NOT_SEEN, dtype=np.int64)
    pixels, number = pixels[towards], number[towards]
    if len(pixels) == 0:
        raise _nothing_in_common(np.empty(0, np.int64), np.empty(0, np.int64))
    origin, direction = forward.rays(pixels)
    hits = traced_as_chosen(
        scene, origin, direction, focus_mm=forward.focus_mm, coherent=True, trace_all=False
    )
    seen = hits.status == Status.GOOD
    lost = np.flatnonzero(np.isin(hits.status, [code for code in Status if code.lost]))
    status[number[hits.ray[lost]]] = ScanStatus.LOST
    few = hits.ray[lost[:MOST]]
    ray, face = hits.ray[seen], hits.refracted_face[seen]
    return _Lit(
        point=hits.refracted[seen],
        normal=scene.part.surface.normals[face],
        face=face,
        place=pixels[ray],
        direction=direction[ray],
        in_air=hits.crossings[seen] > 0,
        pixel=number[ray],
        outcome=hits.status,
        lost=len(lost),
        lost_rays=as_rays("", pixels[few], origin[few], direction[few], hits.status[lost[:MOST]]),
        status=status,
        shape=shape,
    )


def _seen_by(
    scene: Scene, solved: Camera, forward: Camera, lit: _Lit
) -> tuple[IntArray, IntArray, FloatArray, BoolArray, list[LostRay]]:
    """What the other device sees of lit points.

    `ScanStatus` (n,) of the points; numbers (m,) and directions of its lines, and whether they meet
    hot air; its first lost rays.
    """
    distance = row_lengths(lit.point - solved.origin)
    near, far = solved.focus_mm
    # An open part may be seen from the back of its triangles, then by both devices.
    sides = (np.einsum("ij,ij->i", lit.normal, d.origin - lit.point) for d in (forward, solved))
    turned = np.prod(list(sides), axis=0) <= 0
    with np.errstate(invalid="ignore"):
        inside = solved.holds(solved.project(lit.point))
    codes = np.select(
        [~inside, (distance < near) | (distance > far), turned],
        [ScanStatus.OUTSIDE_PICTURE, ScanStatus.OUT_OF_FOCUS, ScanStatus.SHADOW],
        ScanStatus.MEASURED,
    )
    numbers = np.flatnonzero(codes == ScanStatus.MEASURED)
    lines = lines_of_sight(scene, solved.origin, lit.point[numbers])
    clear = np.abs(lines.residual) <= CLEAR_MM
    codes[numbers[~lines.found]] = ScanStatus.SEVERAL_IMAGES
    codes[numbers[lines.lost]] = ScanStatus.LOST
    codes[numbers[lines.found & ~clear]] = ScanStatus.SHADOW
    lost = _lost(scene, solved, lines.direction[lines.lost][:MOST])
    return codes, numbers, lines.direction, lines.in_air, lost


def _lost(scene: Scene, device: Camera, direction: FloatArray) -> list[LostRay]:
    """The lost rays of a device along directions (n, 3), with their status."""
    if len(direction) == 0:
        return []
    origin = np.broadcast_to(device.origin, direction.shape).copy()
    status = traced_as_chosen(scene, origin, direction).status
    return as_rays("", device.project(origin + direction), origin, direction, status)


def _nothing_in_common(forward: IntArray, solved: IntArray) -> InputError:
    """The error that no point is measured, from the outcomes of the rays of both devices."""
    blurred = (forward == Status.OUT_OF_FOCUS).sum() + (solved == ScanStatus.OUT_OF_FOCUS).sum()
    if blurred > 0.5 * len(forward):
        return InputError(
            "The two devices see no point of the part in common, as most of what they see is out "
            "of focus; move them, or change focus_near and focus_far.",
            code="devices.out_of_focus",
            argument="focus",
        )
    return InputError(
        "The two devices see no point of the part in common; point both at the same side, where no "
        "other object hides it.",
        code="devices.nothing_common",
    )


def _pixels(device: Camera, sheet: bool) -> tuple[FloatArray, NDArray[np.uint32], tuple[int, int]]:
    """Positions of a device's rays, px, in tiles; their row-major numbers; rows and columns."""
    width, height = device.resolution
    columns = np.array([(width - 1) / 2]) if sheet else np.arange(width, dtype=np.float64)
    number = pixels_in_tiles(len(columns), height)
    row, column = np.divmod(number, len(columns))
    return np.column_stack((columns[column], row)), number, (height, len(columns))


def _towards_part(device: Camera, part: Part, pixels: FloatArray) -> NDArray[np.bool_]:
    """Mask of the places in a picture, px, at which the part may be seen along straight lines."""
    places = device.project(part.vertices)
    # A distorting lens bends the outline beyond its corners; behind the device there are none.
    if device.distortion is not None or not np.isfinite(places).all():
        return np.ones(len(pixels), dtype=np.bool_)
    low, high = places.min(axis=0), places.max(axis=0)
    return within(pixels, low - 1.0, high + 1.0)

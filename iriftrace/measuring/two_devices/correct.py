"""Remove the refraction error from a measured point cloud.

A sensor found X' where the straight lines of its devices meet; the refracted rays end on X. The
error e(X) = X' - X of a point is computed by `lines_of_sight`, so X is the fixed point of
X <- X' - e(X). Both are solved together: each round traces the lines of both devices once, aims
them again and moves the point. A round reduces the residual as one of `lines_of_sight` does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from iriftrace.camera.camera import Camera
from iriftrace.camera.tiles import tile_numbers
from iriftrace.core.arrays import AnyIntArray, BoolArray, FloatArray, IntArray
from iriftrace.core.blocks import blocks, by_block
from iriftrace.core.errors import InputError, warn
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.mesh.triangles import row_lengths
from iriftrace.measuring.features.drawing import check_growth
from iriftrace.measuring.options import Phase
from iriftrace.measuring.two_devices.changes import pose_changes
from iriftrace.measuring.two_devices.correction import Correction
from iriftrace.measuring.two_devices.correction_status import CorrectionStatus, is_corrected
from iriftrace.measuring.two_devices.device_check import MANY, check_devices, checked_pixels
from iriftrace.measuring.two_devices.devices import Sensor, provenance_of_two, sensor_of
from iriftrace.measuring.two_devices.larger import Larger, in_box, larger_than, sample_of
from iriftrace.measuring.two_devices.statistics import completed
from iriftrace.measuring.two_devices.two_points import lines_of_sight
from iriftrace.measuring.uncertainty.air_groups import AirGroups
from iriftrace.measuring.uncertainty.inputs import NOTHING_STATED, Inputs
from iriftrace.part.part import Part
from iriftrace.tracing.engine import choose
from iriftrace.tracing.lost import warn_of_lost_points
from iriftrace.tracing.scene import Scene
from iriftrace.tracing.second_options import System

REACH_MM = 1.0
"""Largest distance of a point from the part at which it still belongs to the part.

Forged parts deviate from their CAD model by some tenths of a millimetre.
"""

ON_THE_PART_MM = 0.05
"""Tolerated gap along a ray between its end and a point on the part's surface."""

SETTLED_MM = 1e-5
"""Rounds end when point and aims move by less: a hundredth of what sensors resolve."""

ROUNDS = 20
"""A round straight down a plume reduces a residual to a third; twelve reduce 1 mm to 1 nm."""

SAMPLE = 10_000
"""Number of sampled points whose distance from the part is computed."""

PIECE = 1 << 16
"""Number of points that are traced at a time: they fill a processor, and take 30 MB."""

ON_PART_MM = 0.02
"""Median distance below which a cloud lies on the part, so that its size is not checked."""

MOSTLY_PART = 3
"""Least ratio of points nearer than `REACH_MM` to points up to twice as far, in an aligned cloud
that also holds the table. In a cloud that is not aligned both layers have as many points."""

_DOUBTFUL = {
    CorrectionStatus.FAR_FROM_PART: "are far from the part (more than 1 mm) or on its outline and "
    "are not corrected; that is right for a table, clamps and outliers, otherwise align "
    "the cloud with the part.",
    CorrectionStatus.UNCERTAIN: "are corrected by the members' mean, which is less than its "
    "uncertainty (u_normal); add members closer to the air, or find their weights with a board "
    "(iriftrace fit).",
}

_NOT_CORRECTED = {
    CorrectionStatus.FAR_FROM_PART: "are far from the part",
    CorrectionStatus.HIDDEN: "are hidden from a device",
    CorrectionStatus.OUTSIDE_VIEW: "lie behind a device or beyond its lens",
    CorrectionStatus.SEVERAL_IMAGES: "have several images",
    CorrectionStatus.OUTSIDE_FIELD: "are seen through no hot air that is known",
    CorrectionStatus.LOST: "have rays that were lost on the way",
}


def correct(
    points: ArrayLike,
    scene: Scene,
    camera: Camera | None = None,
    second: Camera | None = None,
    *,
    system: System | None = None,
    phase: Phase | None = None,
    inputs: Inputs = NOTHING_STATED,
    pixels: ArrayLike | None = None,
) -> Correction:
    """Remove the refraction error from measured points.

    For an ensemble of fields the correction is the weighted mean over its members, of every point
    whose lines of sight are known: the best estimate of an error is its mean, however uncertain.
    The real air is like the members or between them, or one within the covariance of fitted weights
    (:func:`iriftrace.fit_members`). Where a field that was solved again with one input changed is
    the only one without a correction, its error is that of the field it varies, as if the input had
    no effect there.

    Parameters
    ----------
    points : (n, 3) array, mm, world
        From one scan by these devices, before it was merged with others or aligned.
    scene : Scene
    camera, second, system, phase
        As for `iriftrace.measure`. A laser's sheet is assumed to pass through each point, turned
        about the laser.
    inputs : Inputs
        Standard uncertainties of what the correction rests on.
    pixels : (n, 2) array, px, optional
        Where the camera saw the points, centres of pixels at whole numbers; NaN where that is not
        known. They are compared with the points, see
        `iriftrace.measuring.two_devices.device_check`.

    Raises
    ------
    InputError
        As `iriftrace.measure`, and if there are no points, some are not finite, none lies on the
        part or can be corrected, there are not as many pixels, or `inputs` state the uncertainty of
        a growth that the part does not have.

    Warns
    -----
    IriftraceWarning
        As :func:`iriftrace.tracing.engine.choose`; points do not belong to this part, contradict
        the devices, or lie off the laser's sheet.
    """
    measured = _checked(points)
    seen_at = None if pixels is None else checked_pixels(pixels, len(measured))
    loaded, sensor = sensor_of(scene, camera, second, system, phase)
    check_growth(inputs, loaded.part.growth)
    near_box, to_part = _near_part(measured, loaded.part)
    traced = choose(loaded, *sensor.devices).scene
    groups = AirGroups.of(traced, inputs)
    order, in_view = _order(measured, near_box, sensor)
    varied = [
        place for one in groups.varied.values() for place in np.flatnonzero(one.change).tolist()
    ]
    places = sorted({*traced.counted, *varied})
    found = {
        place: _in_one_field(measured, in_view, order, member, sensor)
        for place, member in zip(places, traced.alone(places), strict=True)
    }
    errors, _, face = found[traced.counted[0]]
    weights = groups.weights
    status = np.max([found[place][1] for place in traced.counted], axis=0)
    errors = errors[None] if weights is None else np.zeros((len(traced.members), *errors.shape))
    if weights is not None:
        for rows in blocks(len(measured)):
            known = {at: (e[rows], is_corrected(code[rows])) for at, (e, code, _) in found.items()}
            errors[:, rows] = completed(known, traced.members, weights)
            status[rows] = _with_doubt(status[rows], errors[:, rows], weights)
    # What stands behind the part, such as a table, is hidden and does not belong to it.
    hidden = np.flatnonzero(status == CorrectionStatus.HIDDEN)
    near = loaded.part.surface.within(measured, REACH_MM, hidden)
    status[hidden[~near]] = CorrectionStatus.FAR_FROM_PART
    _refuse_none(status, measured, loaded.part)
    errors[:, ~is_corrected(status)] = 0.0
    error = errors[0] if weights is None else weights.mean(errors)
    sampled = np.where(is_corrected(status), face, -1)
    larger = _larger(measured - error, loaded.part)
    _warn_of_doubtful(status, larger, loaded.part)
    if doubt := check_devices(measured, status, traced, sensor, seen_at).warning:
        warn(doubt)
    provenance = provenance_of_two(traced, sensor.camera)
    one_line = sensor.system == "laser"
    if one_line:
        provenance["assumptions"]["sheet"] = "through each point, turned about the laser"
        off = by_block(len(measured), lambda rows: sensor.off_sheet(measured[rows]))
        one_line = not _warn_of_other_sheets(off[is_corrected(status)])
    return Correction(
        measured=measured,
        error=error,
        status=status,
        face=face,
        face_normals=loaded.part.surface.normals,
        system=sensor.system,
        provenance=provenance,
        inputs=inputs,
        groups=groups,
        errors=None if weights is None else errors,
        to_part=to_part,
        larger=larger,
        growth=loaded.part.growth,
        one_line=one_line,
        changes=pose_changes(traced, sensor, inputs, measured - error, sampled),
    )


def _in_one_field(
    measured: FloatArray, in_view: BoolArray, order: IntArray, scene: Scene, sensor: Sensor
) -> tuple[FloatArray, AnyIntArray, AnyIntArray]:
    """`_robust_error` of the points whose rows are in `order`, and outcomes of all others."""
    error = np.zeros_like(measured)
    status = np.full(len(measured), CorrectionStatus.FAR_FROM_PART, dtype=np.uint8)
    status[~in_view] = CorrectionStatus.OUTSIDE_VIEW
    face = np.full(len(measured), -1, dtype=np.int32)
    for block in blocks(len(order), PIECE):
        rows = order[block]
        error[rows], status[rows], face[rows] = _robust_error(measured[rows], scene, sensor)
    return error, status, face


def _order(measured: FloatArray, near_box: BoolArray, sensor: Sensor) -> tuple[IntArray, BoolArray]:
    """Numbers of the points that are traced, neighbours together, and mask of those in view."""
    # Clouds come in any order; neighbouring rays are traced faster.
    in_view = np.zeros(len(measured), dtype=bool)
    numbers = np.empty(len(measured), dtype=np.int64)
    for rows in blocks(len(measured)):
        with np.errstate(divide="ignore", invalid="ignore"):
            pixel, second = (device.project(measured[rows]) for device in sensor.devices)
        in_view[rows] = np.isfinite(np.hstack((pixel, second))).all(axis=1)
        numbers[rows] = tile_numbers(pixel)
    order = np.argsort(numbers)
    return order[(in_view & near_box)[order]], in_view


def _checked(points: ArrayLike) -> FloatArray:
    """The points (n, 3) of a cloud that can be corrected."""
    measured = np.asarray(points, dtype=np.float64)
    if measured.ndim != 2 or measured.shape[1:] != (3,) or len(measured) == 0:
        raise InputError(
            f"The cloud is an array of shape {measured.shape}; give n > 0 points, (n, 3), in mm.",
            code="points.shape",
        )
    if not np.isfinite(measured).all():
        raise InputError("Some points are not finite; leave them out.", code="points.not_finite")
    return measured


def _near_part(measured: FloatArray, part: Part) -> tuple[BoolArray, FloatArray]:
    """Mask (n,) of the points in a box around a part, and the distance, mm, of a sample of them.

    The box is larger than the part's by twice `REACH_MM`. Raises InputError for a cloud that does
    not lie on the part.
    """
    near_box = in_box(measured, part, 2.0 * REACH_MM)
    to_part = part.surface.distance(sample_of(measured, SAMPLE, near_box))
    near = int((to_part <= REACH_MM).sum())
    next_to_it = int((to_part <= 2 * REACH_MM).sum()) - near
    if near <= 0.5 * len(to_part) and near <= MOSTLY_PART * next_to_it:
        larger = larger_than(measured, part)
        if larger is not None:
            text, argument = larger.remark(part.growth)
            raise InputError(text, argument=argument, code="cloud.other_size")
        middle = np.median(part.surface.distance(sample_of(measured, SAMPLE)))
        raise InputError(
            f"The cloud lies {middle:.3g} mm from the part (median), so it is another part's, in "
            "another unit or frame, or has other columns; give it in mm in the frame of the scene.",
            code="cloud.off_part",
            argument="cloud_to_part",
        )
    return near_box, to_part


def _larger(points: FloatArray, part: Part) -> Larger | None:
    """Size comparison of corrected points (n, 3) that do not lie on this part; None if they do.

    On a strip of a surface refraction alone looks like another size, by as much as 2 %.
    """
    sample = sample_of(points, SAMPLE, in_box(points, part, 2.0 * REACH_MM))
    off_part = np.median(part.surface.distance(sample)) > ON_PART_MM
    return larger_than(points, part) if off_part else None


def _warn_of_doubtful(status: AnyIntArray, larger: Larger | None, part: Part) -> None:
    """Warn of a cloud of another size, and of many points that cannot belong to this part."""
    if larger is not None:
        text, argument = larger.remark(part.growth)
        warn(text, argument=argument)
    for code, sentence in _DOUBTFUL.items():
        fraction, far = np.mean(status == code), code == CorrectionStatus.FAR_FROM_PART
        # Points far from a part of another size are not a matter of the alignment.
        if fraction > MANY and not (far and larger is not None):
            frame = "cloud_to_part" if far else None
            warn(f"{fraction:.0%} of the points {sentence}", argument=frame)
    lost = int((status == CorrectionStatus.LOST).sum())
    warn_of_lost_points(lost, len(status), "are not corrected")


def _warn_of_other_sheets(off: FloatArray) -> bool:
    """Warn of distances (n,), mm, from a laser's sheet, and say whether it has several lines."""
    fraction = np.mean(off > REACH_MM)
    several = bool(fraction > MANY)
    if several:
        warn(
            f"{fraction:.0%} of the points lie off the laser's sheet, by up to {off.max():.3g} mm; "
            "it is assumed that the sheet was turned while laser and camera stood still. If the "
            "sensor or the part was moved, correct each line by itself with its own devices."
        )
    return several


def _with_doubt(status: AnyIntArray, errors: FloatArray, weights: MemberWeights) -> AnyIntArray:
    """Outcomes (n,) in the air of the members that count, uncertain where these scatter by more."""
    scatter, mean = weights.uncertainty(errors), weights.mean(errors)
    vague = np.linalg.norm(scatter, axis=1) > np.linalg.norm(mean, axis=1)
    vague &= status == CorrectionStatus.CORRECTED
    return np.where(vague, np.uint8(CorrectionStatus.UNCERTAIN), status)


def _refuse_none(status: AnyIntArray, measured: FloatArray, part: Part) -> None:
    """Raise InputError if no point can be corrected."""
    if is_corrected(status).any():
        return
    counts = {code: int((status == code).sum()) for code in _NOT_CORRECTED}
    listed = ", ".join(f"{n:,} {_NOT_CORRECTED[code]}" for code, n in counts.items() if n)
    raise InputError(
        f"None of the {len(status):,} points can be corrected: {listed}; the cloud is "
        f"{_across(measured):.3g} mm across and the part {_across(part.bounds):.3g} mm: "
        "check its unit, its frame and where the scene has the devices.",
        code="cloud.not_corrected",
        argument="cloud_to_part",
    )


def _across(points: FloatArray) -> float:
    """Diagonal of the box around points (n, 3)."""
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _robust_error(
    measured: FloatArray, scene: Scene, sensor: Sensor
) -> tuple[FloatArray, IntArray, IntArray]:
    """`_point_error` with the face of a point, and whether it is seen, made robust to noise.

    Next to a rim, and where a line of sight grazes the part, a point a few micrometres inside the
    material is hidden and one as far outside is not. The remaining points of a hole would then make
    it too small. So the face is the nearest one, and points that seem hidden or far, or to lie on
    another region, are judged as if they lay on it.
    """
    part = scene.part
    error, status, face = _point_error(measured, scene, sensor, REACH_MM)
    place = measured - error
    foot, nearest = part.surface.nearest(place)
    near = row_lengths(foot - place) <= REACH_MM
    region = part.region_of_face
    doubtful = np.isin(status, (CorrectionStatus.HIDDEN, CorrectionStatus.FAR_FROM_PART))
    rows = np.flatnonzero(near & (doubtful | (region[face] != region[nearest])))
    face[near] = nearest[near]
    if len(rows):
        on_part = foot[rows] + error[rows]
        error[rows], status[rows], _ = _point_error(on_part, scene, sensor, ON_THE_PART_MM)
    return error, status, face


def _point_error(
    measured: FloatArray, scene: Scene, sensor: Sensor, reach_mm: float
) -> tuple[FloatArray, IntArray, IntArray]:
    """`error`, `status` and `face` of points as in `Correction`, in one field.

    Those whose rays end farther from them than `reach_mm` are hidden or far from the part.
    """
    place = measured.copy()
    offsets = np.zeros((2, *measured.shape))
    residual = np.full((len(measured), 2), np.nan)
    face = np.full(len(measured), -1)
    found, in_air, lost = np.zeros((3, len(measured)), dtype=bool)
    for _ in range(ROUNDS):
        if len(active := np.flatnonzero(~found & ~lost)) == 0:
            break
        # Not copied while all are active.
        rows = slice(None) if len(active) == len(measured) else active
        one, other = (
            lines_of_sight(scene, device.origin, place[rows], offset[rows], rounds=1)
            for device, offset in zip(sensor.devices, offsets, strict=True)
        )
        moved = np.zeros(len(active))
        for offset, line in zip(offsets, (one, other), strict=True):
            moved = np.maximum(moved, row_lengths(line.offset - offset[rows]))
            offset[rows] = line.offset
        residual[rows] = np.column_stack((one.residual, other.residual))
        face[rows] = one.face
        in_air[rows] = one.in_air | other.in_air
        lost[rows] = one.lost | other.lost
        step = measured[rows] - sensor.triangulated(one.direction, other.direction)[0]
        place[rows] += step
        moved = np.maximum(moved, row_lengths(step))
        found[rows] = moved <= SETTLED_MM
    with np.errstate(invalid="ignore"):
        # NaN where a ray misses the part.
        far = ~(residual >= -reach_mm).all(axis=1)
        hidden = (residual > reach_mm).any(axis=1)
    status = np.select(
        [lost, ~found, far, hidden, ~in_air],
        [
            CorrectionStatus.LOST,
            CorrectionStatus.SEVERAL_IMAGES,
            CorrectionStatus.FAR_FROM_PART,
            CorrectionStatus.HIDDEN,
            CorrectionStatus.OUTSIDE_FIELD,
        ],
        CorrectionStatus.CORRECTED,
    )
    return measured - place, status, face

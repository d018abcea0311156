"""Weights of an ensemble's members from measured shifts of what is seen through their air.

The shift that a member predicts at a place of the hot picture is that place minus the projection
of the point where its refracted ray ends. A motion of the camera between the pictures may be
fitted as well. Several views of boards give their shifts to one fit, each weighted by its noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from attrs import field, frozen
from scipy.linalg import block_diag

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.statistics import rms
from iriftrace.image.aov_image import Status
from iriftrace.io.measured_shift import MeasuredShift
from iriftrace.measuring.camera_motion import interaction_matrix
from iriftrace.measuring.fit.member_fit import (
    INDISTINCT,
    FittedDots,
    FittedView,
    MemberFit,
    check_count,
    fitted_places,
    member_fit,
    members_in,
)
from iriftrace.measuring.fit.shift_mixture import ShiftMixture
from iriftrace.measuring.fit.shift_noise import shift_noise
from iriftrace.measuring.fit.shift_signs import warn_of_signs
from iriftrace.measuring.map_size import refuse_other_size
from iriftrace.tracing.engine import choose
from iriftrace.tracing.provenance import provenance
from iriftrace.tracing.rays import traced_as_chosen
from iriftrace.tracing.scene import Scene, ready_scene

OFF_BOARD = 0.2
"""Fraction of dots next to the board above which they belong to another camera."""


@frozen(eq=False)
class BoardView:
    """What one camera saw of one board, and what the members predict; n dots, k members.

    `hot` (n, 2) are their places in the hot picture, px, and `seen` (n, 3), mm, world, on the
    board. `free` (n, 2, 6) are derivatives of the shifts by a motion of the camera, if it is
    fitted.
    """

    scene: Scene
    camera: Camera
    shifts: MeasuredShift
    places: FloatArray = field(repr=False)
    hot: FloatArray = field(repr=False)
    seen: FloatArray = field(repr=False)
    predicted: FloatArray = field(repr=False)
    measured: FloatArray = field(repr=False)
    free: FloatArray | None = field(repr=False)
    dots: dict[str, int]
    noise: float


def fit_members(
    scene: Scene,
    shifts: MeasuredShift,
    *,
    others: Sequence[tuple[Scene, MeasuredShift]] = (),
    noise_px: float | None = None,
    camera_motion: bool = False,
) -> MemberFit:
    """Fit the weights of an ensemble's members to measured shifts of a board's dots.

    Parameters
    ----------
    scene : Scene
        An ensemble whose part is the board and whose camera took both pictures; the hot part in
        front of it is a blocker.
    shifts : MeasuredShift
        Positions in the cold picture and shifts to the hot one, in pixels of the camera's full
        resolution (:func:`iriftrace.read_measured_shift`).
    others : sequence of (scene, shifts)
        Further boards or cameras in the same air, with the same members in the same order. One
        view hardly sees how far a plume leans along its own line of sight; a second one does.
    noise_px : float, px, optional
        Standard deviation of a component of the shifts; by default from the differences of
        neighbouring residuals (`shift_noise`), for each view by itself.
    camera_motion : bool
        Fit a rigid motion of each camera between its pictures, too.

    Raises
    ------
    InputError
        The scene is not an ensemble; a map of shifts has another size than the camera's picture;
        the dots are another camera's, hidden, or fewer than the members; the members' shifts do not
        differ, as with a board in front of the part; or views have different members.

    Warns
    -----
    IriftraceWarning
        There are fewer than four members, or shifts of another sign match far better.
    """
    if noise_px is not None and not noise_px > 0.0:
        raise InputError(
            f"The noise is {noise_px:g} px; give a positive number.",
            code="noise.not_positive",
            argument="noise",
        )
    pairs = [(scene, shifts), *others]
    views = [_view(ready_scene(one), seen, noise_px, camera_motion) for one, seen in pairs]
    first = views[0]
    for other in views[1:]:
        _check_members(first.scene, other.scene)
    # In pixels of the first view, in units of which all have the same noise.
    scales = [first.noise / view.noise for view in views]
    both = list(zip(scales, views, strict=True))
    found = ShiftMixture(
        np.concatenate([scale * view.predicted for scale, view in both], axis=1),
        np.concatenate([scale * view.measured for scale, view in both]),
        motions_of(both) if camera_motion else None,
    )
    return member_fit(
        members_in(first.scene),
        found,
        first.noise,
        noise_source="differences of neighbouring residuals" if noise_px is None else "stated",
        unit="px",
        measured=rms(np.concatenate([(scale * view.measured).ravel() for scale, view in both])),
        dots={key: sum(view.dots[key] for view in views) for key in first.dots},
        views=_fitted(found, both),
        provenance=provenance(first.scene, first.camera),
    )


def _view(
    scene: Scene, shifts: MeasuredShift, noise_px: float | None, camera_motion: bool
) -> BoardView:
    """The members' predictions at the dots of one view, which must differ."""
    fitted = fitted_places(members_in(scene))
    view = view_of(scene, shifts, fitted, noise_px, camera_motion)
    predicted, measured, free = view.predicted, view.measured, view.free
    _check_spread(rms((predicted - predicted.mean(axis=0)).ravel()), view.noise)
    warn_of_signs(
        lambda signs: ShiftMixture(predicted, signs * measured, free).residual, shifts.origin.path
    )
    return view


def view_of(
    scene: Scene,
    shifts: MeasuredShift,
    fitted: Sequence[int],
    noise_px: float | None,
    camera_motion: bool,
) -> BoardView:
    """The predictions of members at some places, from 0, at the dots, by their traced rays."""
    # At the resolution of its film before ``scale`` changed it.
    full = scene.compiled.unscaled(scene.camera)
    camera = scene.camera.scaled(full[0] / scene.camera.resolution[0])
    check_count(len(shifts.places), len(fitted), "dots on the board")
    size = tuple(int(pixels) for pixels in full)
    remedy = "give shifts between pictures of the scene's camera at its full resolution"
    refuse_other_size(shifts, size, "the camera", remedy)
    _check_in_picture(shifts, camera)
    hot = shifts.places + shifts.shifts
    traced = choose(scene, camera).scene
    points, status = seen_by_members(traced.alone(fitted), camera, hot)
    good = (status == Status.GOOD).all(axis=0)
    dots = {"failed": shifts.failed, "zeros": shifts.zeros, **_counts(status)}
    _check_dots(dots, len(fitted))
    predicted = hot[good] - np.array([camera.project(seen[good]) for seen in points])
    measured, places = shifts.shifts[good], shifts.places[good]
    free = interaction_matrix(camera, points[0][good]) if camera_motion else None
    noise = noise_px
    if noise is None:
        alone = ShiftMixture(predicted, measured, free)
        noise = shift_noise(places[alone.used], alone.left(alone.weights))
    seen = points[0][good]
    return BoardView(
        *(traced, camera, shifts, places, hot[good], seen, predicted, measured, free, dots, noise)
    )


def motions_of(views: Sequence[tuple[float, BoardView]]) -> FloatArray:
    """Derivatives (n, 2, 6 v) of all shifts by the motions of v cameras, each of its own view."""
    rows = [scale * view.free.reshape(-1, 6) for scale, view in views if view.free is not None]
    return np.asarray(block_diag(*rows).reshape(-1, 2, 6 * len(rows)))


def _fitted(
    found: ShiftMixture, views: Sequence[tuple[float, BoardView]]
) -> tuple[FittedView, ...]:
    """What the fit leaves in each view, in pixels of its own camera."""
    left = found.left(found.weights, everywhere=True)
    ends = np.cumsum([len(view.measured) for _, view in views])
    motions = [None] * len(views) if found.motion is None else found.motion.reshape(-1, 6)
    return tuple(
        FittedView(
            origin=view.shifts.origin,
            residual=rms((rest[used] / scale).ravel()),
            noise=view.noise,
            motion=motion,
            dots=FittedDots(
                *(view.seen, view.measured, rest / scale, used),
                provenance(view.scene, view.camera),
            ),
        )
        for (scale, view), rest, used, motion in zip(
            views, np.split(left, ends[:-1]), np.split(found.used, ends[:-1]), motions, strict=True
        )
    )


def _check_members(first: Scene, other: Scene) -> None:
    """Refuse views whose members are not the same fields in the same order."""
    listed = [[m.state for m in members_in(scene)] for scene in (first, other)]
    if listed[0] != listed[1]:
        raise InputError(
            f"{other.name} has other members than {first.name}, so one fit cannot use both views; "
            "write both scenes with the same fields in the same order.",
            code="scene.other_members",
            argument="member",
        )


def _check_in_picture(shifts: MeasuredShift, camera: Camera) -> None:
    width, height = camera.resolution
    outside = ~camera.holds(shifts.places)
    if outside.any():
        raise InputError(
            f"{outside.sum():,} of {len(outside):,} dots in {shifts.origin.path} lie outside "
            f"the camera's picture of {width} x {height} px, so they are shifts from "
            "another camera or of a scaled picture; give those of the camera in the scene, at its "
            "full resolution.",
            code="shifts.outside_picture",
        )


def seen_by_members(
    scenes: Iterable[Scene], camera: Camera, hot: FloatArray
) -> tuple[FloatArray, IntArray]:
    """Points (k, n, 3), mm, seen at places of the hot picture by member, and status (k, n)."""
    origins, directions = camera.rays(hot)
    points, status = [], []
    for scene in scenes:
        hits = traced_as_chosen(scene, origins, directions)
        whole = np.full((len(hot), 3), np.nan)
        code = np.full(len(hot), int(Status.MISSED))
        whole[hits.ray], code[hits.ray] = hits.refracted, hits.status
        points.append(whole)
        status.append(code)
    return np.array(points), np.array(status)


def _counts(status: IntArray) -> dict[str, int]:
    """Numbers of dots by the outcome of their rays in the members."""
    hidden = (status == Status.BLOCKED).any(axis=0)
    off_board = (status == Status.MISSED).any(axis=0) & ~hidden
    lost = (status != Status.GOOD).any(axis=0) & ~hidden & ~off_board
    return {
        "measured": status.shape[1],
        "hidden": int(hidden.sum()),
        "beside": int(off_board.sum()),
        "lost": int(lost.sum()),
    }


def _check_dots(dots: dict[str, int], members: int) -> None:
    """Refuse dots that do not lie on the board, or are too few."""
    measured, off_board, hidden = dots["measured"], dots["beside"], dots["hidden"]
    usable = measured - off_board - hidden - dots["lost"]
    if off_board > OFF_BOARD * measured:
        raise InputError(
            f"{off_board:,} of {measured:,} dots lie next to the board in the scene's camera, "
            "so the shifts are from another camera, or camera or board stand elsewhere; correct "
            "the scene's camera, or the board's place.",
            code="shifts.off_board",
            argument="part_transform",
        )
    if hidden == measured:
        raise InputError(
            f"All {measured:,} dots lie on the hot part or on another blocker, which hides the "
            "board there; give shifts of dots on the board.",
            code="shifts.hidden",
        )
    others = f" ({hidden:,} dots are hidden, {off_board:,} next to the board)"
    check_count(usable, members, "dots on the board", others)


def _check_spread(spread: float, noise: float) -> None:
    """Refuse members whose shifts, px, differ too little at the dots."""
    if spread < INDISTINCT * noise:
        raise InputError(
            f"The members' shifts of the dots differ by {spread:.2g} px, less than a tenth of the "
            f"noise of {noise:.2g} px, so weights cannot be determined; a board in front of the "
            "part or far from its plume sees no hot air: place it behind the part.",
            code="fit.indistinct",
        )

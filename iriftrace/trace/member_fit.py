"""Weights of an ensemble's members from measured shifts of what is seen through their air.

The shift that a member predicts at a place of the hot picture is that place minus the projection
of the point where its refracted ray ends. Weights are not negative and sum to 1, so the fit is a
mixture of the members. A motion of the camera between the pictures may be fitted as well.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from attrs import evolve, field, frozen

from iriftrace.camera.camera import Camera
from iriftrace.core.arrays import FloatArray, IntArray
from iriftrace.core.errors import InputError
from iriftrace.core.plain import JsonObject
from iriftrace.core.statistics import rms
from iriftrace.image.aov_image import Status
from iriftrace.image.camera_motion import interaction_matrix
from iriftrace.image.measured_shift import MeasuredShift
from iriftrace.image.shift_mixture import MOST_OUTLIERS, ShiftMixture
from iriftrace.image.shift_noise import shift_noise
from iriftrace.scene.ensemble import FieldMember
from iriftrace.scene.loaded import LoadedEnsemble, LoadedScene
from iriftrace.scene.member_weights import MemberWeights
from iriftrace.scene.scene import AnyScene, loaded_scene
from iriftrace.trace.engine import choose
from iriftrace.trace.provenance import provenance
from iriftrace.trace.rays import traced_as_chosen

SCHEMA = "iriftrace.fit/1"

DOUBTFUL = 2.0
"""Residual, as a multiple of the noise, from which on the members are not the measured air."""

INDISTINCT = 0.1
"""Members whose shifts differ by less, relative to their noise, cannot be told apart."""

OFF_BOARD = 0.2
"""Fraction of dots next to the board above which they belong to another camera."""


@frozen(eq=False)
class MemberFit:
    """Weights with which the members' predictions match the measured values.

    Attributes
    ----------
    members : tuple of FieldMember
        All members of the scene, with their fitted weights and rows of the covariance.
    covariance : (k, k) array
        Covariance of the weights. It has the residual as noise of the measured values, and as a
        systematic difference of the air by as much as the residual exceeds the noise: towards the
        nearest members, or of the whole contrast.
    unit : str
        Unit of the next four values: ``"px"`` for shifts, ``"K"`` for temperatures.
    residual, noise : float
        Root mean square of a component of the residual of the fit, and of its noise.
    single : (k,) array
        Residual of each member by itself.
    foreign : float
        Fraction of the values whose residual exceeds the noise and any member's prediction, as in
        air of another kind (`ShiftMixture.foreign`).
    measured : float
        Root mean square of a component of the measured shifts, or of the temperatures' excess over
        the ambient one.
    dots : dict of int
        Numbers ``measured``, ``used`` and ``outliers``; for shifts also ``hidden`` by a body,
        ``beside`` (next to the board) and ``lost``.
    motion : (6,) array or None
        Translation, mm, and rotation vector, rad, of the camera between the pictures, in its own
        frame; None where it was not fitted.
    """

    members: tuple[FieldMember, ...]
    covariance: FloatArray = field(repr=False)
    unit: str
    residual: float
    noise: float
    single: FloatArray = field(repr=False)
    foreign: float
    measured: float
    dots: dict[str, int]
    motion: FloatArray | None
    provenance: JsonObject = field(repr=False)

    @property
    def weights(self) -> MemberWeights:
        """Weights of all members, with their covariance."""
        return MemberWeights(np.array([m.weight for m in self.members]), self.covariance)

    @property
    def ratio(self) -> float:
        """Residual over noise."""
        return self.residual / self.noise

    @property
    def contained(self) -> bool:
        """True if the residual is below `DOUBTFUL` times the noise."""
        return self.ratio < DOUBTFUL

    @property
    def verdict(self) -> str:
        """One sentence on whether the members contain the measured air."""
        found = (
            f"the residual of {self.residual:.3g} {self.unit} is {self.ratio:.3g} times the noise"
        )
        if self.contained:
            return f"These members reproduce what was measured: {found}."
        return f"These members do not contain your air: {found}."

    @property
    def serving(self) -> tuple[FieldMember, ...]:
        """Members with weight, and those without weight that the covariance needs."""
        rows = zip(self.members, self.covariance, strict=True)
        return tuple(m for m, row in rows if m.weight > 0.0 or row.any())

    @property
    def refused(self) -> bool:
        """True if the measured air is of another kind, so that no scene is made of the members."""
        return not self.contained and self.foreign > MOST_OUTLIERS

    def require_contained(self) -> None:
        """Raise InputError if the members are far from the measured air."""
        if self.refused:
            what = {"px": "dots move farther", "K": "temperatures rise higher"}[self.unit]
            raise InputError(
                f"{self.verdict[:-1]}, and {self.foreign:.0%} of the {what} than in any member. No "
                "scene is written; add members that are closer (other speeds and directions of the "
                "draught, other bodies), or check that camera, board and places are those measured."
            )

    def as_dict(self) -> JsonObject:
        """Plain JSON values, schema ``iriftrace.fit/1``."""
        labels = zip(self.members, self.single.tolist(), strict=True)
        motion = None if self.motion is None else self.motion.tolist()
        return {
            "schema": SCHEMA,
            **self.provenance,
            "verdict": self.verdict,
            "unit": self.unit,
            "residual": self.residual,
            "noise": self.noise,
            "measured": self.measured,
            "foreign": self.foreign,
            "effective_members": self.weights.effective,
            "dots": self.dots,
            "camera_motion": None
            if motion is None
            else {"translation_mm": motion[:3], "rotation_rad": motion[3:]},
            "members": [
                {"number": m.number, "label": m.label, "weight": m.weight, "alone": alone}
                for m, alone in labels
            ],
            "covariance": self.covariance.tolist(),
        }


def fit_members(
    scene: AnyScene,
    shifts: MeasuredShift,
    *,
    noise_px: float | None = None,
    camera_motion: bool = False,
) -> MemberFit:
    """Fit the weights of an ensemble's members to measured shifts of a board's dots.

    Parameters
    ----------
    scene : Scene, LoadedScene or path
        An ensemble whose part is the board and whose camera took both pictures; the hot part in
        front of it is a blocker.
    shifts : MeasuredShift
        Positions in the cold picture and shifts to the hot one, in pixels of the camera's full
        resolution (:func:`iriftrace.read_measured_shift`).
    noise_px : float, px, optional
        Standard deviation of a component of the shifts; by default from the differences of
        neighbouring residuals (`shift_noise`).
    camera_motion : bool
        Fit a rigid motion of the camera between the pictures, too.

    Raises
    ------
    InputError
        The scene is not an ensemble; the dots are another camera's, hidden, or fewer than the
        members; or the members' shifts do not differ, as with a board in front of the part.
    """
    loaded = loaded_scene(scene)
    ensemble = members_in(loaded)
    if noise_px is not None and not noise_px > 0.0:
        raise InputError(f"The noise is {noise_px:g} px; give a positive number.")
    # At the resolution of its film before ``scale`` changed it.
    camera = loaded.camera.scaled(loaded.full_resolution[0] / loaded.camera.resolution[0])
    check_count(len(shifts.places), len(ensemble), "dots on the board")
    _check_in_picture(shifts, camera)
    hot = shifts.places + shifts.shifts
    chosen = choose(loaded, camera).scene.ensemble
    assert chosen is not None
    points, status = _seen(chosen.scenes(), camera, hot)
    good = (status == Status.GOOD).all(axis=0)
    dots = _counts(status)
    _check_dots(dots, len(ensemble))
    predicted = hot[good] - np.array([camera.project(seen[good]) for seen in points])
    free = interaction_matrix(camera, points[0][good]) if camera_motion else None
    found = ShiftMixture(predicted, shifts.shifts[good], free)
    noise = noise_px
    if noise is None:
        noise = shift_noise(shifts.places[good][found.used], found.left(found.weights))
    _check_spread(rms((predicted - predicted.mean(axis=0)).ravel()), noise)
    return member_fit(
        ensemble.members,
        found,
        noise,
        unit="px",
        measured=rms(shifts.shifts[good].ravel()),
        dots=dots,
        provenance={
            **provenance(loaded, camera),
            "shifts": {"path": shifts.path, "sha256": shifts.sha256},
        },
    )


def member_fit(
    members: Sequence[FieldMember],
    found: ShiftMixture,
    noise: float,
    *,
    unit: str,
    measured: float,
    dots: dict[str, int],
    provenance: JsonObject,
) -> MemberFit:
    """Assemble the results of a fit; attributes as of `MemberFit`."""
    covariance = found.covariance(noise)
    fitted = MemberWeights(found.weights, covariance).rows
    return MemberFit(
        members=tuple(
            evolve(member, weight=weight, covariance=row)
            for member, (weight, row) in zip(members, fitted, strict=True)
        ),
        covariance=covariance,
        unit=unit,
        residual=found.residual,
        noise=noise,
        single=np.array([rms(found.left(alone).ravel()) for alone in np.eye(len(fitted))]),
        foreign=found.foreign(noise),
        measured=measured,
        dots={**dots, "used": int(found.used.sum()), "outliers": int((~found.used).sum())},
        motion=found.motion,
        provenance=provenance,
    )


def members_in(scene: LoadedScene) -> LoadedEnsemble:
    """The members of a scene; raises InputError if it has only one field."""
    if scene.ensemble is None:
        raise InputError(
            f"{scene.name} has one field, so there are no weights to fit; make it of several "
            "states of the air (iriftrace scene --member)."
        )
    return scene.ensemble


def check_count(values: int, members: int, what: str, others: str = "") -> None:
    """Refuse fewer measured values than members."""
    if values < members:
        raise InputError(
            f"{values:,} {what} are fewer than the {members} members, so their weights cannot be "
            f"determined{others}; measure more of them, or use fewer members."
        )


def _check_in_picture(shifts: MeasuredShift, camera: Camera) -> None:
    width, height = camera.resolution
    outside = ~camera.holds(shifts.places)
    if outside.any():
        raise InputError(
            f"{outside.sum():,} of {len(outside):,} dots in {shifts.path} lie outside the camera's "
            f"picture of {width} x {height} px, so they are shifts from another camera or of a "
            "scaled picture; give those of the camera in the scene, at its full resolution."
        )


def _seen(
    scenes: Iterable[LoadedScene], camera: Camera, hot: FloatArray
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
            "the scene's camera, or the board's place (--part-transform)."
        )
    if hidden == measured:
        raise InputError(
            f"All {measured:,} dots lie on the hot part or on another blocker, which hides the "
            "board there; give shifts of dots on the board."
        )
    others = f" ({hidden:,} dots are hidden, {off_board:,} next to the board)"
    check_count(usable, members, "dots on the board", others)


def _check_spread(spread: float, noise: float) -> None:
    """Refuse members whose shifts, px, differ too little at the dots."""
    if spread < INDISTINCT * noise:
        raise InputError(
            f"The members' shifts of the dots differ by {spread:.2g} px, less than a tenth of the "
            f"noise of {noise:.2g} px, so weights cannot be determined; a board in front of the "
            "part or far from its plume sees no hot air: place it behind the part."
        )

"""Weights of an ensemble's members that were fitted to a measurement.

Weights are not negative and sum to 1, so the fit is a mixture of the members.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import evolve, field, frozen

from iriftrace.core.arrays import BoolArray, FloatArray
from iriftrace.core.errors import InputError, warn
from iriftrace.core.files import FileOrigin
from iriftrace.core.member_weights import MemberWeights
from iriftrace.core.plain import JsonObject, plain
from iriftrace.core.statistics import rms
from iriftrace.io.cloud_write import save_cloud
from iriftrace.measuring.fit.next_members import members_to_solve
from iriftrace.measuring.fit.shift_mixture import MOST_OUTLIERS, ShiftMixture
from iriftrace.tracing.hot_air import FieldMember
from iriftrace.tracing.scene import Scene

SCHEMA = "iriftrace.fit/3"

FEWEST = 4
"""Number of members below which the uncertainty of their weights does not hold."""

DOUBTFUL = 2.0
"""Residual, as a multiple of the noise, from which on the air is outside the members."""

EXPLAINED = 0.8
"""Another contrast is the difference of the air if less than this fraction of the residual is left
with it."""

INDISTINCT = 0.1
"""Members whose shifts differ by less, relative to their noise, cannot be told apart."""


@frozen(eq=False)
class FittedDots:
    """The n dots of a board that a camera saw.

    Attributes
    ----------
    points : (n, 3) array, mm, world
    shift, residual : (n, 2) arrays, px
        Measured shifts, and these less the fit's.
    used : (n,) array of bool
        Dots that are not outliers.
    provenance : dict
        Of the scene with this board.
    """

    points: FloatArray = field(repr=False)
    shift: FloatArray = field(repr=False)
    residual: FloatArray = field(repr=False)
    used: BoolArray = field(repr=False)
    provenance: JsonObject = field(repr=False)

    def save(self, path: str | Path, values: JsonObject) -> tuple[Path, Path]:
        """Write the dots as a cloud with further JSON values next to it.

        Columns, px: ``shift_u``, ``shift_v``, ``residual_u``, ``residual_v``, and ``residual``,
        the length; ``used`` is 1 for dots that are not outliers.
        """
        (du, dv), (left_u, left_v) = self.shift.T, self.residual.T
        columns = {
            **{"shift_u": du, "shift_v": dv, "residual_u": left_u, "residual_v": left_v},
            "residual": np.hypot(left_u, left_v),
            "used": self.used.astype(np.int32),
        }
        return save_cloud(path, self.points, columns, {**values, **self.provenance})


@frozen(eq=False)
class FittedView:
    """What a fit leaves of one file of measured values.

    Attributes
    ----------
    origin : FileOrigin
        The file.
    residual, noise : float
        Root mean square of a component of the residual, and of its noise, px or K.
    motion : (6,) array or None
        Translation, mm, and rotation vector, rad, of the camera between the pictures, in its own
        frame; None where it was not fitted.
    dots : FittedDots or None
        Of a board.
    """

    origin: FileOrigin
    residual: float
    noise: float
    motion: FloatArray | None = None
    dots: FittedDots | None = None

    def as_dict(self) -> JsonObject:
        """Plain JSON values."""
        motion = None if self.motion is None else self.motion.tolist()
        return {
            **plain(self.origin),
            "residual": self.residual,
            "noise": self.noise,
            "camera_motion": None
            if motion is None
            else {"translation_mm": motion[:3], "rotation_rad": motion[3:]},
        }


@frozen(eq=False)
class MemberFit:
    """Weights with which the members' predictions match the measured values.

    Attributes
    ----------
    members : tuple of FieldMember
        All members of the scene, with their fitted weights and rows of the covariance. Those that
        vary another one are not fitted; they keep the weight 0.
    covariance : (k, k) array
        Covariance of the weights, 0 for members that were not fitted. It has the residual as noise
        of the measured values (`birge`), and as a systematic difference of the air by as much as
        the residual exceeds the noise: towards the nearest members, or of the whole contrast.
    unit : str
        Unit of the next four values: ``"px"`` (of the first camera) for shifts, ``"K"`` for
        temperatures.
    residual, noise : float
        Root mean square of a component of the residual of the fit, and of its noise.
    noise_source : str
        Origin of the noise that the residual is compared with.
    single : (k,) array
        Residual of each member by itself; NaN for those that were not fitted.
    foreign : float
        Fraction of the values whose residual exceeds the noise and any member's prediction, as in
        air of another kind (`ShiftMixture.foreign`).
    scale, scaled : float
        Factor of the mixture's contrast that is closest to the measured values, and the residual
        with it.
    measured : float
        Root mean square of a component of the measured shifts, or of the temperatures' excess over
        the ambient one.
    dots : dict of int
        Numbers ``measured``, ``used`` and ``outliers``; for shifts also ``hidden`` by a body,
        ``beside`` (next to the board) and ``lost``, and in the files besides ``measured`` those
        marked as ``failed`` and ``zeros`` that were left out.
    views : tuple of FittedView
        The fit's measured files, each with its own residual.
    """

    members: tuple[FieldMember, ...]
    covariance: FloatArray = field(repr=False)
    unit: str
    residual: float
    noise: float
    noise_source: str
    single: FloatArray = field(repr=False)
    foreign: float
    scale: float
    scaled: float
    measured: float
    dots: dict[str, int]
    views: tuple[FittedView, ...]
    provenance: JsonObject = field(repr=False)

    @property
    def weights(self) -> MemberWeights:
        """Weights of all members, with their covariance and whether the air is outside them."""
        weights = np.array([m.weight for m in self.members])
        return MemberWeights(weights, self.covariance, "" if self.contained else self.verdict)

    @property
    def ratio(self) -> float:
        """Residual over noise."""
        return self.residual / self.noise

    @property
    def birge(self) -> float:
        """Birge ratio, sqrt(chi^2 / f) or 1: factor of the weights' u from the noise alone."""
        return max(1.0, self.ratio)

    @property
    def contained(self) -> bool:
        """True if the residual is below `DOUBTFUL` times the noise."""
        return self.ratio < DOUBTFUL

    @property
    def verdict(self) -> str:
        """One sentence on whether the members contain the measured air, and how far it is."""
        found = (
            f"the residual of {self.residual:.3g} {self.unit} is {self.ratio:.3g} times the noise"
        )
        if self.contained:
            return f"These members reproduce what was measured: {found}."
        what = {"px": "dots move farther", "K": "temperatures rise higher"}[self.unit]
        other = (
            f", and {self.foreign:.0%} of the {what} than in any member"
            if self.foreign > 0.005
            else ""
        )
        return (
            f"Air outside the members: {found} and {self.residual / self.measured:.0%} of what was "
            f"measured{other}; U includes it as far as members have hot air where devices look."
        )

    @property
    def solve_next(self) -> str:
        """One sentence on which members to solve; "" if these contain the measured air."""
        if self.contained:
            return ""
        return members_to_solve(
            [self.members[place] for place in fitted_places(self.members)],
            self.scale if self.scaled < EXPLAINED * self.residual else 1.0,
            other_body=self.foreign > MOST_OUTLIERS,
        )

    @property
    def serving(self) -> tuple[FieldMember, ...]:
        """Members with weight, those that the covariance needs, and both sides of a variation."""
        varied = {m.variation.of for m in self.members if m.variation is not None}
        rows = zip(self.members, self.covariance, strict=True)
        return tuple(
            m
            for m, row in rows
            if m.weight > 0.0 or row.any() or m.variation is not None or m.source.sha256 in varied
        )

    def as_dict(self) -> JsonObject:
        """Plain JSON values, schema ``iriftrace.fit/3``."""
        labels = zip(self.members, self.single.tolist(), strict=True)
        return {
            "schema": SCHEMA,
            **self.provenance,
            "verdict": self.verdict,
            "contained": self.contained,
            "solve_next": self.solve_next,
            "unit": self.unit,
            "residual": self.residual,
            "noise": self.noise,
            "noise_source": self.noise_source,
            "birge": self.birge,
            "measured": self.measured,
            "foreign": self.foreign,
            "scale": self.scale,
            "scaled_residual": self.scaled,
            "effective_members": self.weights.effective,
            "dots": self.dots,
            "views": [view.as_dict() for view in self.views],
            "members": [
                {
                    "number": m.number,
                    "label": m.label,
                    "weight": m.weight,
                    "alone": None if np.isnan(alone) else alone,
                }
                for m, alone in labels
            ],
            "covariance": self.covariance.tolist(),
        }


def member_fit(
    members: Sequence[FieldMember],
    found: ShiftMixture,
    noise: float,
    *,
    noise_source: str,
    unit: str,
    measured: float,
    dots: dict[str, int],
    views: tuple[FittedView, ...],
    provenance: JsonObject,
) -> MemberFit:
    """Assemble the results of a fit of the `fitted_places`; attributes as of `MemberFit`."""
    places = fitted_places(members)
    if len(places) < FEWEST:
        warn(
            f"The uncertainty of weights knows only the air between the {len(places)} members; "
            f"give at least {FEWEST}, such as two speeds of two directions of the draught.",
            argument="member",
        )
    count = len(members)
    weights, single, covariance = np.zeros(count), np.full(count, np.nan), np.zeros((count, count))
    weights[places] = found.weights
    single[places] = [rms(found.left(alone).ravel()) for alone in np.eye(len(places))]
    covariance[np.ix_(places, places)] = found.covariance(noise)
    fitted = MemberWeights(weights, covariance).rows
    scale, scaled = found.scaled()
    return MemberFit(
        members=tuple(
            evolve(member, weight=weight, covariance=row)
            for member, (weight, row) in zip(members, fitted, strict=True)
        ),
        covariance=covariance,
        unit=unit,
        residual=found.residual,
        noise=noise,
        noise_source=noise_source,
        single=single,
        foreign=found.foreign(noise),
        scale=scale,
        scaled=scaled,
        measured=measured,
        dots={**dots, "used": int(found.used.sum()), "outliers": int((~found.used).sum())},
        views=views,
        provenance=provenance,
    )


def members_in(scene: Scene) -> tuple[FieldMember, ...]:
    """The members of a scene; raises InputError if it has only one state of the air."""
    if len(fitted_places(scene.members)) < 2:
        raise InputError(
            f"{scene.name} has one field that can have a weight, so there are none to fit; make it "
            "of several states of the air.",
            code="scene.one_field",
            argument="member",
        )
    return scene.members


def fitted_places(members: Sequence[FieldMember]) -> list[int]:
    """Places of the members that are states of the air, and do not vary another one."""
    return [place for place, member in enumerate(members) if member.variation is None]


def check_count(values: int, members: int, what: str, others: str = "") -> None:
    """Refuse fewer measured values than members."""
    if values < members:
        raise InputError(
            f"{values:,} {what} are fewer than the {members} members, so their weights cannot be "
            f"determined{others}; measure more of them, or use fewer members.",
            code="fit.too_few_values",
        )

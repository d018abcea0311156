"""Groups of inputs on which the effect of the air depends, and what each changes.

The effect of the air on anything that is measured (a displacement, a point, a diameter) is linear
in the members of an ensemble. Other inputs scale it, or change it by as much as a member that was
solved again with one input changed differs from the one that it varies.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from attrs import Factory, frozen
from numpy.typing import ArrayLike

from iriftrace.core.arrays import FloatArray
from iriftrace.core.member_weights import MemberWeights
from iriftrace.measuring.uncertainty.budget import Mixture
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.measuring.uncertainty.similarity import SOURCE, humidity_effect, relative_effects
from iriftrace.medium.source import FieldKind, FieldSource
from iriftrace.tracing.hot_air import OUTSIDE

if TYPE_CHECKING:
    from iriftrace.tracing.scene import Scene

AIR = "air around the part"
"""The group of the members, or of one field that stands for the air."""

CONTRAST = "contrast of the air"
"""The group of the stated uncertainty of the air's effect as a whole."""

UNSTEADY = "unsteadiness of the air"

_RANGE = 2.0 * np.sqrt(3.0)
"""Range over standard deviation of a value that may lie anywhere in between (GUM, 4.3.7)."""


@frozen
class Scaled:
    """A group by which the whole effect of the air scales: its relative standard uncertainty."""

    relative: float
    source: str


@frozen
class SolvedAgain:
    """A group by a member that was solved again: its number and that of what it varies, from 0.

    `factor` is the stated standard uncertainty over the step between both.
    """

    member: int
    base: int
    factor: float
    source: str


@frozen(eq=False)
class AirGroups:
    """What is known of the uncertainty of the effect of a scene's air.

    Attributes
    ----------
    weights : MemberWeights or None
        Of an ensemble's members.
    scaled, varied : mappings
        By the name of the group.
    source : str
        Where the group of the members comes from; "" if the air is not known.
    missing : tuple of str
        Groups that are not known, without which U is a lower bound.
    synthetic : bool
        The air is of a formula.
    """

    weights: MemberWeights | None = None
    scaled: Mapping[str, Scaled] = Factory(dict)
    varied: Mapping[str, SolvedAgain] = Factory(dict)
    source: str = ""
    missing: tuple[str, ...] = (AIR,)
    synthetic: bool = False

    @property
    def known(self) -> bool:
        """True if the uncertainty by any group is known."""
        return bool(self.source or self.scaled or self.varied)

    def parts(self, mean: ArrayLike, by_member: FloatArray | None) -> dict[str, FloatArray]:
        """Standard uncertainties (...) by group of the air's effect.

        Parameters
        ----------
        mean : (...) array
            The effect, 0 without hot air.
        by_member : (k, ...) array or None
            That in the air of each member.
        """
        effect = np.asarray(mean, dtype=np.float64)
        found = {name: np.abs(one.relative * effect) for name, one in self.scaled.items()}
        if by_member is not None and self.weights is not None:
            for name, one in self.varied.items():
                step = by_member[one.member] - by_member[one.base]
                found[name] = np.abs(one.factor * step)
            if self.source:
                found[AIR] = self.weights.uncertainty(by_member)
        return found

    def mixture(self, by_member: FloatArray | None) -> Mixture | None:
        """Distribution of the effect (k,) over all mixtures of members that were not fitted."""
        if by_member is None or self.weights is None or self.weights.covariance is not None:
            return None
        if not self.source:
            return None
        return Mixture(AIR, self.weights.weights, by_member)

    def total(self, mean: ArrayLike, by_member: FloatArray | None) -> FloatArray:
        """Combined standard uncertainty (...) of the air's effect by all groups."""
        squares = [np.square(u) for u in self.parts(mean, by_member).values()]
        return np.asarray(np.sqrt(np.sum(squares, axis=0)))

    def sources(self) -> dict[str, str]:
        """Where each group comes from."""
        both: dict[str, Scaled | SolvedAgain] = {**self.scaled, **self.varied}
        return {AIR: self.source, **{name: one.source for name, one in both.items()}}

    @classmethod
    def of(cls, scene: Scene, inputs: Inputs) -> AirGroups:
        """The groups of a scene's air with the stated uncertainties."""
        weights = scene.weights if scene.members else None
        scaled = _scaled(scene, inputs)
        varied = _varied(scene, inputs)
        for name in varied:
            scaled.pop(name, None)
        kinds = [one.facts.kind for one in _in_mean(scene)]
        synthetic = FieldKind.SYNTHETIC in kinds
        if synthetic:
            scaled.pop(CONTRAST, None)
        source = "" if synthetic else _members(weights)
        missing = []
        if not source and CONTRAST not in scaled:
            missing.append(AIR)
        if _is_one_state(scene) and UNSTEADY not in scaled:
            missing.append(UNSTEADY)
        if OUTSIDE in scene.compiled.stated.notes:
            missing.append("air outside the members")
        return cls(weights, scaled, varied, source, tuple(missing), synthetic)


def _members(weights: MemberWeights | None) -> str:
    """Where the group of the members comes from; "" without several of them."""
    if weights is not None and weights.covariance is not None:
        return f"{weights.sampled} members, fitted to a measurement"
    if weights is not None and weights.several:
        return f"any mixture of {weights.sampled} members"
    return ""


def _in_mean(scene: Scene) -> list[FieldSource]:
    """The fields of which the mean consists."""
    if not scene.members:
        return [] if scene.compiled.source is None else [scene.compiled.source]
    return [one.source for one in scene.members if one.weight > 0.0]


def _scaled(scene: Scene, inputs: Inputs) -> dict[str, Scaled]:
    stated = scene.compiled.stated
    found = {}
    if inputs.air is not None:
        found[CONTRAST] = Scaled(inputs.air, "stated")
    if inputs.mesh is not None:
        found["mesh and model of the flow"] = Scaled(inputs.mesh, "stated")
    if inputs.numerics is not None:
        found["numerics"] = Scaled(inputs.numerics, "stated")
    if (change := unsteadiness(scene)) is not None:
        found[UNSTEADY] = Scaled(change, "range over time that the field states")
    if stated.air is not None and stated.heating_k is not None:
        wall_k = stated.air.temperature_k + stated.heating_k
        for name, relative in relative_effects(inputs, wall_k, stated.air).items():
            found[name] = Scaled(abs(relative), SOURCE)
        if inputs.humidity is not None:
            change = humidity_effect(inputs.humidity, stated.air)
            found["humidity"] = Scaled(abs(change), "index of moist air")
    return found


def _varied(scene: Scene, inputs: Inputs) -> dict[str, SolvedAgain]:
    """Groups of the members that were solved again with one input changed."""
    given = {"wall": inputs.wall_k, "ambient": inputs.ambient_k, "pressure": inputs.pressure_pa}
    found: dict[str, SolvedAgain] = {}
    place = {one.source.sha256: number for number, one in enumerate(scene.members)}
    for number, one in enumerate(scene.members):
        variation = one.variation
        if variation is None:
            continue
        base, stated = place[variation.of], given[variation.quantity]
        if stated is not None:
            factor = stated / variation.step
            found[variation.quantity] = SolvedAgain(number, base, factor, "solved again")
    return found


def _is_one_state(scene: Scene) -> bool:
    """True if the mean is one field of unsteady air, which no measurement has chosen."""
    kinds = [one.facts.kind for one in _in_mean(scene)]
    fitted = bool(scene.members) and scene.weights.covariance is not None
    return kinds == [FieldKind.UNSTEADY] and not fitted


def unsteadiness(scene: Scene) -> float | None:
    """Relative standard uncertainty of unsteady air, which a scan sees in one state.

    By the larger of the relative ranges of heat flow and plume, as a rectangular distribution; None
    for other air (`_is_one_state`), or if the field does not state its range.
    """
    heating_k = scene.compiled.stated.heating_k
    if not _is_one_state(scene):
        return None
    (facts,) = (one.facts for one in _in_mean(scene))
    if facts.heat_variation is None or facts.plume_swing_k is None or heating_k is None:
        return None
    return float(max(facts.heat_variation, facts.plume_swing_k / heating_k) / _RANGE)

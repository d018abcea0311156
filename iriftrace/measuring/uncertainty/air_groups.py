"""Groups of inputs on which the effect of the air depends, and what each changes.

The effect of the air on anything that is measured (a displacement, a point, a diameter) is linear
in the members of an ensemble. Other inputs scale it, or change it by as much as a member that was
solved again with one input changed differs from the one that it varies.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from attrs import Factory, frozen
from numpy.typing import ArrayLike
from scipy.special import ndtri

from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import warn
from iriftrace.core.member_weights import MemberWeights
from iriftrace.measuring.uncertainty.budget import SEED, Mixture, dirichlet
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.measuring.uncertainty.similarity import SOURCE, humidity_effect, relative_effects
from iriftrace.medium.source import FieldKind, FieldSource
from iriftrace.tracing.hot_air import OUTSIDE, solved_again

if TYPE_CHECKING:
    from iriftrace.tracing.scene import Scene

AIR = "air around the part"
"""The group of the members, or of one field that stands for the air."""

CONTRAST = "contrast of the air"
"""The group of the stated uncertainty of the air's effect as a whole."""

UNSTEADY = "unsteadiness of the air"

OTHER_AIR = "air other than the scene's"
"""The group of air by which corrected points scatter more than the measured ones."""

BEYOND = "air beyond the data"
"""The group of a field that ends at a feature, some of whose points are seen through no hot air."""

_RANGE = 2.0 * np.sqrt(3.0)
"""Range over standard deviation of a value that may lie anywhere in between (GUM, 4.3.7)."""


@frozen
class Scaled:
    """A group by which the whole effect of the air scales: its relative standard uncertainty."""

    relative: float
    source: str


@frozen(eq=False)
class SolvedAgain:
    """A group by members that were solved again with one input changed.

    `change` (k,) are the multiples of the members' effects whose sum is the change of the effect by
    one standard uncertainty; they add up to 0.
    """

    change: FloatArray
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
        found: dict[str, FloatArray] = {}
        largest = np.abs(np.asarray(mean, dtype=np.float64))
        if by_member is not None and self.weights is not None:
            for name, one in self.varied.items():
                used = np.flatnonzero(one.change)
                found[name] = np.abs(np.tensordot(one.change[used], by_member[used], axes=1))
            if self.source:
                found[AIR] = self.weights.uncertainty(by_member)
                # The variance of a product: what scales the effect scales that of the real air.
                largest = np.hypot(largest, found[AIR])
        return found | {name: one.relative * largest for name, one in self.scaled.items()}

    def mixture(self, by_member: FloatArray | None) -> Mixture | None:
        """Distribution of the effect (k,) over all mixtures of members that were not fitted."""
        if by_member is None or self.weights is None or self.weights.covariance is not None:
            return None
        if not self.source:
            return None
        relative = math.hypot(*(one.relative for one in self.scaled.values()))
        return Mixture(AIR, self.weights.weights, by_member, tuple(self.scaled), relative)

    def mixtures(self, count: int) -> FloatArray | None:
        """Weights (count, k) of mixed air at Sobol points of the members and varied inputs.

        Their sums are 1; a varied input adds a part of one field and subtracts it of another. None
        with nothing to mix.
        """
        if self.weights is None or not (self.weights.several or self.varied):
            return None
        used = np.flatnonzero(self.weights.weights)
        from scipy.stats import qmc  # half a second, which reading of tolerances need not take

        sequence = qmc.Sobol(len(used) + len(self.varied), rng=np.random.default_rng(SEED))
        units = np.clip(sequence.random(count), 1e-6, 1.0 - 1e-6)
        found = np.zeros((count, len(self.weights.weights)))
        found[:, used] = dirichlet(self.weights.weights[used], units[:, : len(used)])
        for one, unit in zip(self.varied.values(), units.T[len(used) :], strict=True):
            found += np.outer(ndtri(unit), one.change)
        return found

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
        synthetic = FieldKind.SYNTHETIC in [one.facts.kind for one in _in_mean(scene)]
        if synthetic:
            scaled.pop(CONTRAST, None)
        source = "" if synthetic else _members(weights)
        missing = []
        if not source and CONTRAST not in scaled:
            missing.append(AIR)
        if _unsteady(scene) is None:
            missing.append(UNSTEADY)
        missing += [name for name in _stated_of_flow(inputs) if name not in {**scaled, **varied}]
        if OUTSIDE in scene.compiled.stated.notes:
            missing.append("air outside the members")
        if (states := inputs.states or 1.0) > 1.0 and UNSTEADY not in scaled:
            warn(
                f"The {states:g} states that are averaged change nothing, as the scene's air "
                "states no range over time (it is steady, fitted to a measurement, several "
                "snapshots, or of an unknown range); leave them out.",
                argument="uncertainty",
            )
        return cls(weights, scaled, varied, source, tuple(missing), synthetic)


def _members(weights: MemberWeights | None) -> str:
    """Where the group of the members comes from; "" without several of them."""
    if weights is not None and weights.covariance is not None:
        return f"{weights.sampled} members, fitted to a measurement"
    if weights is not None and weights.several:
        return f"{weights.sampled} members, any state like them or between"
    return ""


def _stated_of_flow(inputs: Inputs) -> dict[str, float]:
    """Stated uncertainties of what a flow solution depends on, by the name of their group."""
    names = ("wall", "ambient", "pressure", "humidity")
    return {name: value for name, value in inputs.stated().items() if name in names}


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
    if change := _unsteady(scene):
        states = inputs.states or 1.0
        averaged = f", mean of {states:g} states" if states > 1.0 else ""
        source = f"range over time that the field states{averaged}"
        found[UNSTEADY] = Scaled(change / np.sqrt(states), source)
    if stated.air is not None and stated.heating_k is not None:
        wall_k = stated.air.temperature_k + stated.heating_k
        for name, relative in relative_effects(inputs, wall_k, stated.air).items():
            found[name] = Scaled(abs(relative), SOURCE)
        if inputs.humidity is not None:
            change = humidity_effect(inputs.humidity, stated.air)
            found["humidity"] = Scaled(abs(change), "index of moist air")
    return found


def _varied(scene: Scene, inputs: Inputs) -> dict[str, SolvedAgain]:
    """Groups of the members that were solved again with one input changed.

    If several members were with the same input, the change is the mean of theirs, weighted as the
    members that they vary.
    """
    found = {}
    for name, stated in _stated_of_flow(inputs).items():
        solved = solved_again(scene.members, name)
        if not solved:
            continue
        weights = np.array([scene.weights.weights[base] for _, base, _ in solved])
        if not weights.any():
            weights[:] = 1.0
        change = np.zeros(len(scene.members))
        for (number, base, step), share in zip(solved, weights / weights.sum(), strict=True):
            change[number] += share * stated / step
            change[base] -= share * stated / step
        found[name] = SolvedAgain(change, "solved again")
    return found


def _unsteady(scene: Scene) -> float | None:
    """Relative standard uncertainty of the air because it changes while a scan sees one state.

    By the larger of the relative ranges of heat flow and plume that each field of the mean states,
    as a rectangular distribution. 0 for steady air, for snapshots whose scatter has it, and for
    weights that a measurement has chosen; None if a range is not known, as that of a mean over time
    by another program.
    """
    fields, heating_k = _in_mean(scene), scene.compiled.stated.heating_k
    fitted = bool(scene.members) and scene.weights.covariance is not None
    times = [_time(one, scene) for one in fields]
    if fitted or (len(fields) > 1 and set(times) == {"snapshot"}):
        return 0.0
    ranges = []
    for one, time in zip(fields, times, strict=True):
        facts = one.facts
        if facts.kind is not FieldKind.UNSTEADY and time not in ("mean", "snapshot"):
            ranges.append(0.0)
        elif facts.heat_variation is None or facts.plume_swing_k is None or heating_k is None:
            return None
        else:
            ranges.append(max(facts.heat_variation, facts.plume_swing_k / heating_k))
    weights = scene.weights.weights if scene.members else np.ones(1)
    return float(weights[weights > 0.0] @ ranges / _RANGE) if ranges else 0.0


def _time(source: FieldSource, scene: Scene) -> str:
    """Time dependence of a field, as its file or the user states; "" if neither does."""
    return source.time if source.steady else scene.compiled.stated.notes.get("time", source.time)

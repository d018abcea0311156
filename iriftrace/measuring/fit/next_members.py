"""Members of an ensemble to solve next, where a fit finds the measured air outside of it."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from attrs import frozen

from iriftrace.medium.source import FieldSource
from iriftrace.tracing.hot_air import FieldMember

_NAME = re.compile(r"^at_(\d+\.\d+)(?:_from_(\d+(?:\.\d+)?))?\.vtu$")
_DRAUGHT = re.compile(r"draught of (\S+) m/s from (\S+) deg")
_WALL = re.compile(r"\bwall (\S+) K")

ALONE = 0.9
"""Weight of one speed or direction above which the air is not between it and others."""

TURN_DEG = 10.0
"""Step of directions where members have one only: plumes of draughts farther apart do not mix."""


@frozen
class Blown:
    """Draught that a member was solved for."""

    speed: float  # m/s, 0 for still air
    source: float | None  # degrees, where it comes from; None for still air


def draught_of(source: FieldSource) -> Blown | None:
    """Draught by the name or the origin that the program itself writes; None if not known."""
    named = _NAME.match(Path(source.path).name)
    if named:
        return Blown(float(named[1]), None if named[2] is None else float(named[2]))
    # The air between fields has the origin of the first of them.
    if not source.origin.startswith("OpenFOAM"):
        return None
    stated = _DRAUGHT.search(source.origin)
    if stated:
        return Blown(float(stated[1]), float(stated[2]))
    return None if "draught" in source.origin else Blown(0.0, None)


def members_to_solve(
    members: Sequence[FieldMember], scale: float = 1.0, *, other_body: bool = False
) -> str:
    """One sentence on the members that are likely closer to the measured air.

    `members` have their fitted weights; `scale` is the factor of the contrast that is closest to
    the measured values, where it explains the residual. With `other_body` some values exceed
    those of all members, as in the plume of another body.
    """
    if scale != 1.0:
        walls = [float(text[1]) for m in members if (text := _WALL.search(m.source.origin))]
        known = f" than {max(walls) if scale > 1.0 else min(walls):g} K" if walls else ""
        return (
            f"Solve next: {'hotter' if scale > 1.0 else 'cooler'} walls{known}, as the contrast of "
            f"the air is about {scale:.2g} times that of the mixture."
        )
    blown = [draught_of(member.source) for member in members]
    known_air = [one for one in blown if one is not None]
    if len(known_air) < len(members):
        nearest = max(members, key=lambda member: member.weight)
        wanted = (
            f"states around {nearest.label}, which has the most weight, with other speeds and "
            "directions of the draught"
        )
    else:
        wanted = _draughts(known_air, [member.weight for member in members])
    others = ", and other bodies that stand in the hall" if other_body else ""
    return f"Solve next: {wanted}, and other temperatures of the wall{others}."


def _draughts(blown: Sequence[Blown], weights: Sequence[float]) -> str:
    """Speeds and directions between or beyond those of the members."""
    by_speed: defaultdict[float, float] = defaultdict(float)
    by_source: defaultdict[float, float] = defaultdict(float)
    for one, weight in zip(blown, weights, strict=True):
        by_speed[one.speed] += weight
        if one.source is not None:
            by_source[one.source] += weight
    speeds = _listed(speed for speed in _nearby(by_speed, 0.5 * max(by_speed)) if speed > 0.0)
    if not by_source:
        return "draughts of several speeds and directions"
    if by_speed[0.0] > ALONE * sum(weights):
        return (
            f"draughts of {speeds} m/s from other directions than {_listed(sorted(by_source))} deg"
        )
    # The two sides of 0 degrees are neighbours.
    heaviest = max(by_source, key=lambda source: by_source[source])
    turned = {(source - heaviest + 180.0) % 360.0 - 180.0: w for source, w in by_source.items()}
    sources = [(heaviest + turn) % 360.0 for turn in _nearby(turned, TURN_DEG)]
    return f"draughts of {speeds} m/s and from {_listed(sources)} deg"


def _listed(values: Iterable[float]) -> str:
    return " and ".join(f"{round(value, 4):g}" for value in values)


def _nearby(weights: Mapping[float, float], step: float) -> list[float]:
    """Values around the one with the most weight, or between it and the heavier neighbour."""
    best = max(weights, key=lambda value: weights[value])
    below = max((value for value in weights if value < best), default=None)
    above = min((value for value in weights if value > best), default=None)
    sides = [side for side in (below, above) if side is not None]
    if weights[best] < ALONE * sum(weights.values()):
        return [0.5 * (best + max(sides, key=lambda side: weights[side]))]
    apart = min((abs(best - side) for side in sides), default=step)
    lower = best - apart if below is None else 0.5 * (below + best)
    upper = best + apart if above is None else 0.5 * (best + above)
    return [lower, upper]

"""Family of draughts around one part: its members, solved, mirrored, or between others."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise, product

import numpy as np
from attrs import frozen

from iriftrace.core.errors import InputError
from iriftrace.flow.simulate.draught import Draught, check_speed, draught_from
from iriftrace.flow.simulate.options import DraughtOptions

_MOST_MEMBERS = 1000

MOST_APART_DEG = 30.0
"""Directions farther apart have no member between them: their plumes differ by more than a move.

Tried for 10 degrees (docs/board.md).
"""


@frozen
class FamilyMember:
    """One draught of a family; its field is ``NAME.vtu`` in the family's folder."""

    name: str
    draught: Draught | None  # None in still air
    planes: str  # axes at whose centre plane it is mirrored, so a half or a quarter is solved
    image_of: str = ""  # name of the member whose mirror image it is, so it is not solved
    across: str = ""  # axes across which that one is mirrored
    # Names of members and their shares, between which it lies, so it is not solved.
    between: tuple[tuple[str, float], ...] = ()

    @property
    def file(self) -> str:
        """Name of its field's file."""
        return f"{self.name}.vtu"

    @property
    def solved(self) -> bool:
        """True if its flow is solved, and not made from that of other members."""
        return not (self.image_of or self.between)


def _check_family(speeds: Sequence[float], directions: Sequence[float]) -> None:
    """Refuse speeds, m/s, and directions, degrees, that do not form a family."""
    for speed in speeds:
        check_speed(speed)
    blowing = [speed for speed in speeds if speed > 0.0]
    if blowing and not directions:
        raise InputError(
            "the draughts have no directions; say where they come from, such as "
            "0,90,180,270 degrees (0 is +x).",
            code="family.no_directions",
            argument="draught_from",
        )
    if directions and not blowing:
        raise InputError(
            f"{len(directions)} directions of still air are one and the same field; give speeds "
            "above 0, or leave the directions out.",
            code="family.still_air",
            argument="draughts",
        )
    turns = np.sort(np.mod(directions, 360.0))
    if (np.diff(turns) < 1e-6).any():
        raise InputError(
            "a direction is given twice, so that its members would count twice; give each once (0 "
            "and 360 degrees are the same).",
            code="family.same_direction",
            argument="draught_from",
        )
    if len(blowing) * len(directions) >= _MOST_MEMBERS:
        raise InputError(
            f"{len(blowing) * len(directions)} members are too many for a family; give fewer "
            f"speeds or directions, at most {_MOST_MEMBERS} together.",
            code="family.too_many",
        )


def plan_family(wind: DraughtOptions, planes: str, symmetric: str) -> tuple[FamilyMember, ...]:
    """Members of a family, in the order of their names.

    A speed of 0 is one member for all directions. `planes` are axes of "xy" at whose centre plane
    the field may be mirrored; a draught that blows through a plane is solved without it.
    `symmetric` are axes across which part and wall temperatures are symmetric: mirror images of
    other draughts are not solved.
    """
    speeds, directions = wind.draughts or (), wind.draught_from or ()
    _check_family(speeds, directions)
    turns = sorted(float(np.mod(direction, 360.0)) for direction in directions)
    originals = _originals(turns, symmetric)
    members: list[FamilyMember] = []
    digits = _digits(speeds)
    for speed in sorted(speeds):
        if speed == 0.0:
            # On the same mesh as others, and free to sway like them.
            first = _left(planes, turns[0]) if turns else planes
            members.append(FamilyMember(_name(speed, 0.0, digits), None, first))
            continue
        for turn in turns:
            name = _name(speed, turn, digits)
            draught = draught_from(speed, (turn,))
            left = _left(planes, turn)
            original, across = originals.get(turn, (turn, ""))
            image_of = _name(speed, original, digits) if across else ""
            members.append(FamilyMember(name, draught, left, image_of, across))
    if wind.between:
        places = product(sorted(speeds), turns)
        halfway = _halfway({place: _name(*place, digits) for place in places})
        if not halfway:
            raise InputError(
                "no member lies between others, as there is one speed and no two directions are "
                f"within {MOST_APART_DEG:g} degrees of each other; give more of them, or ask "
                "for none between.",
                code="family.none_between",
                argument="between",
            )
        members += halfway
    return tuple(members)


def _halfway(names: Mapping[tuple[float, float], str]) -> list[FamilyMember]:
    """Members halfway between those with these names by speed, m/s, and direction, degrees."""
    speeds = sorted({speed for speed, _ in names})
    turns = sorted({turn for _, turn in names})
    of_speed = _halved(pairwise(speeds))
    round_about = pairwise((*turns, turns[0] + 360.0)) if turns else ()
    of_turn = {
        middle % 360.0: (one, other % 360.0)
        for middle, (one, other) in _halved(round_about).items()
        if other - one <= MOST_APART_DEG
    }
    digits = _digits([*speeds, *of_speed])
    found = []
    for speed, turn in product(sorted([*speeds, *of_speed]), sorted([*turns, *of_turn])):
        if speed == 0.0 or (speed in speeds and turn in turns):
            continue
        around = product(of_speed.get(speed, (speed,)), of_turn.get(turn, (turn,)))
        # The member of still air is that of all directions.
        shares = Counter(names[place] for place in around)
        between = tuple((name, count / shares.total()) for name, count in shares.items())
        draught = draught_from(speed, (turn,))
        found.append(FamilyMember(_name(speed, turn, digits), draught, "", between=between))
    return found


def _halved(pairs: Iterable[tuple[float, float]]) -> dict[float, tuple[float, float]]:
    """Pairs of neighbours by their middle."""
    return {round(0.5 * (one + other), 9): (one, other) for one, other in pairs}


def _digits(speeds: Iterable[float]) -> int:
    """Decimal places that names need to distinguish speeds, at least 2."""
    return max(2, *(len(f"{speed:.9f}".rstrip("0").partition(".")[2]) for speed in speeds))


def _name(speed: float, turn: float, digits: int) -> str:
    """Name of a member; still air has no direction."""
    return f"at_{speed:.{digits}f}" + (f"_from_{_degrees(turn)}" if speed else "")


def _originals(turns: Sequence[float], symmetric: str) -> dict[float, tuple[float, str]]:
    """Directions, degrees, that mirror an earlier one: that one, and the axes of the mirrors."""
    found: dict[float, tuple[float, str]] = {}
    for number, turn in enumerate(turns):
        for original in turns[:number]:
            images = {"x": 180.0 - original, "y": -original, "xy": 180.0 + original}
            fitting = [
                axes
                for axes, image in images.items()
                if set(axes) <= set(symmetric)
                and abs((image - turn + 180.0) % 360.0 - 180.0) < 1e-6
            ]
            if fitting and original not in found:
                found[turn] = original, fitting[0]
                break
    return found


def _left(planes: str, turn: float) -> str:
    """The planes that are symmetric in wind from a direction, degrees."""
    wind = draught_from(1.0, (turn,))
    crossed = "" if wind is None else wind.crossed(planes)
    return "".join(axis for axis in planes if axis not in crossed)


def _degrees(turn: float) -> str:
    """An angle as part of a name that sorts, 090 or 022.5."""
    whole, _, rest = f"{turn:.6f}".rstrip("0").partition(".")
    return f"{int(whole):03d}" + (f".{rest}" if rest else "")

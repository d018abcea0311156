"""Family of draughts around one part: its members, and which of them are solved or mirrored."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from attrs import frozen

from iriftrace.cfd.openfoam.draught import Draught, check_speed, draught_from
from iriftrace.core.errors import InputError

_MOST_MEMBERS = 1000


@frozen
class Member:
    """One draught of a family; its field is ``NAME.vtu`` in the family's folder."""

    name: str
    draught: Draught | None  # None in still air
    planes: str  # axes at whose centre plane it is mirrored, so a half or a quarter is solved
    image_of: str = ""  # name of the member whose mirror image it is, so it is not solved
    across: str = ""  # axes across which that one is mirrored

    @property
    def file(self) -> str:
        """Name of its field's file."""
        return f"{self.name}.vtu"


def check_family(speeds: Sequence[float], directions: Sequence[float]) -> None:
    """Refuse speeds, m/s, and directions, degrees, that do not form a family."""
    for speed in speeds:
        check_speed(speed)
    blowing = [speed for speed in speeds if speed > 0.0]
    if blowing and not directions:
        raise InputError(
            "the draughts have no directions; say where they come from with --draught-from "
            "0,90,180,270 (degrees, 0 is +x)."
        )
    if directions and not blowing:
        raise InputError(
            f"{len(directions)} directions of still air are one and the same field; give speeds "
            "above 0, such as --draughts 0:0.2:0.02, or leave out --draught-from."
        )
    turns = np.sort(np.mod(directions, 360.0))
    if (np.diff(turns) < 1e-6).any():
        raise InputError(
            "--draught-from names a direction twice, so that its members would count twice; give "
            "each once (0 and 360 degrees are the same)."
        )
    if len(blowing) * len(directions) >= _MOST_MEMBERS:
        raise InputError(
            f"{len(blowing) * len(directions)} members are too many for a family; give fewer "
            f"speeds or directions, at most {_MOST_MEMBERS} together."
        )


def plan_family(
    speeds: Sequence[float], directions: Sequence[float], planes: str, symmetric: str
) -> tuple[Member, ...]:
    """Members of a family, in the order of their names.

    Speeds are in m/s; 0 is one member for all directions. Directions are where the air comes from,
    degrees from +x to +y. `planes` are axes of "xy" at whose centre plane the field may be
    mirrored; a draught that blows through a plane is solved without it. `symmetric` are axes across
    which part and wall temperatures are symmetric: mirror images of other draughts are not solved.
    """
    check_family(speeds, directions)
    digits = max(len(f"{speed:.9f}".rstrip("0").partition(".")[2]) for speed in speeds)
    digits = max(2, digits)
    turns = sorted(float(np.mod(direction, 360.0)) for direction in directions)
    originals = _originals(turns, symmetric)
    members: list[Member] = []
    for speed in sorted(speeds):
        if speed == 0.0:
            # On the same mesh as others, and free to sway like them.
            first = _left(planes, turns[0]) if turns else planes
            members.append(Member(f"at_{0.0:.{digits}f}", None, first))
            continue
        for turn in turns:
            name = f"at_{speed:.{digits}f}_from_{_degrees(turn)}"
            draught = draught_from(speed, (turn,))
            left = _left(planes, turn)
            original, across = originals.get(turn, (turn, ""))
            image_of = f"at_{speed:.{digits}f}_from_{_degrees(original)}" if across else ""
            members.append(Member(name, draught, left, image_of, across))
    return tuple(members)


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

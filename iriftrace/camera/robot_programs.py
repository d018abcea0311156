"""Cartesian positions in programs of robots, as tables of poses.

KUKA's ``E6POS`` and ``POS`` (.dat, .src), ABB's robtargets (.mod), Fanuc's positions (.ls) and
``movel(p[...])`` and waypoints of Universal Robots (.script). Joint positions, offsets and relative
motions are ignored.
"""

from __future__ import annotations

import re
from pathlib import Path

from iriftrace.camera.robot_poses import ROBOTS, RobotName
from iriftrace.core.errors import InputError, warn

_NUMBER = r"\s*([-+]?\d*\.?\d+(?:[eE][-+]?\d+)?)\s*"
_THREE = ",".join([_NUMBER] * 3)
_FOUR = ",".join([_NUMBER] * 4)

_POSITIONS: dict[RobotName, re.Pattern[str]] = {
    "kuka": re.compile(
        r"(?:\bE6POS\s+\w+\s*=|\bPOS\s+\w+\s*=|\bS?(?:PTP|LIN))\s*\{"
        + r"\s*,".join(rf"\s*{name}\s{_NUMBER}" for name in "XYZABC"),
        re.IGNORECASE,
    ),
    # A tool or work object has no configuration of four numbers.
    "abb": re.compile(rf"\[\s*\[{_THREE}\]\s*,\s*\[{_FOUR}\]\s*,\s*\[{_FOUR}\]"),
    "fanuc": re.compile(
        ",".join(
            rf"\s*{name}\s*={_NUMBER}{unit}\s*"
            for unit, names in (("mm", "XYZ"), ("deg", "WPR"))
            for name in names
        )
    ),
    # Tools (set_tcp) and planes are poses, too; waypoints of PolyScope end in _p.
    "universal": re.compile(rf"(?:\bmove[jlp]\s*\(|\w_p\s*=)\s*p\[{_THREE},{_THREE}\]"),
}
_FRAMES = re.compile(r"\b(?:U[FT] *:|(?:TOOL|BASE)_NO) *\d+|\\WObj *:= *\w+", re.IGNORECASE)
_PROGRAM = re.compile(
    r"^\s*(?:&ACCESS|DEFDAT\s|DEF\s+\w+\s*\(|/PROG\b|/JOB\b|(?:SYS)?MODULE\s+\w|def\s+\w+\s*\(.*:)",
    re.MULTILINE,
)


def table_of_program(text: str, path: Path) -> tuple[RobotName, str] | None:
    """The robot whose program a text is, and its positions as a table; None for no program.

    Raises InputError for a program without positions. Warned of is the frame of the positions.
    """
    if not _PROGRAM.search(text):
        return None
    text = re.sub(r"^\s*[;!#].*", "", text, flags=re.MULTILINE)  # comments
    for robot, form in _POSITIONS.items():
        count = 3 + len(ROBOTS[robot].columns)
        rows = [",".join(match.groups()[:count]) for match in form.finditer(text)]
        if rows:
            frames = dict.fromkeys(re.sub(r"\W+", " ", each) for each in _FRAMES.findall(text))
            warn(
                f"The positions in {path.name} ({len(rows)}) are those of the program's tool in "
                f"its base (user frame, work object; {', '.join(frames) or 'not named'}): give the "
                "camera in that tool (--hand-eye) and the motion from that base to the part "
                "(--base-to-part), which have to be the same for all."
            )
            unit = " [m]" if robot == "universal" else ""
            names = [f"{axis}{unit}" for axis in "xyz"] + list(ROBOTS[robot].columns)
            return robot, "\n".join([",".join(names), *rows])
    raise InputError(
        f"{path} is a program of a robot without positions that are read here (E6POS or POS of "
        "KUKA, robtargets of ABB, X to R of Fanuc, movel(p[...]) of Universal Robots); write its "
        "poses as a table with the columns x, y, z and the robot's angles."
    )

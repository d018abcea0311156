"""Twin experiments of `iriftrace fit` on solved families of draughts: the table of docs/board.md.

    S='iriftrace field simulate part.ply --wall-temperature 1100degC'
    $S -o family --draughts 0:0.3:0.05 --draught-from 90 --background-cell "36 mm" --symmetry x
    $S -o fine --draughts 0.12:0.18:0.01 --draught-from 90 --background-cell "36 mm" --symmetry x
    C='--draught-from 90 --background-cell 44mm --symmetry x'
    $S -o coarse --draughts 0.12:0.18:0.02 $C
    $S -o strong/case --field strong/field.vtu --draught "0.4 m/s" $C
    $S -o second/case --field second/field.vtu --draught "0.15 m/s" $C \
        --body second.stl --body-temperature "900 degC"
    $S -o turned --draughts 0.14:0.16:0.01 --draught-from 80,85,90 --background-cell 44mm \
        --end-time 8s --average-time 5s
    $S -o wide --draughts 0.12:0.16:0.01 $C --end-time 8s --average-time 5s
    iriftrace part cylinder -o stub.ply --diameter 50mm --length 70mm
    S='iriftrace field simulate stub.ply --wall-temperature 950degC --background-cell 44mm'
    $S -o stub/still_case --field stub/still.vtu --end-time 4s --average-time 2s
    $S -o stub/true_case --field stub/at_0.14_from_080.vtu --draught "0.14 m/s" \
        --draught-from 80 --end-time 4s --average-time 2s
    $S -o stub --draughts 0.12:0.16:0.04 --draught-from 75,90 --end-time 4s --average-time 2s
    python -m validation.board_twin .

part.ply is `scenes/cylinder/part.ply`; second.stl is a block of 60 x 30 x 30 mm around (0, -75, 0).
A state that is not a member is the truth: its traced shifts get 0.05 px of noise, and the cloud of
two devices to the lee is corrected.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import numpy as np
from attrs import evolve, frozen

import iriftrace
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import IriftraceWarning
from iriftrace.core.mesh.transform import parse_transform
from iriftrace.io.measured_shift import MeasuredShift
from iriftrace.part.board import Board
from validation.inputs.cameras import camera_at
from validation.inputs.leaning_air import measured_shifts

BOARD = Board((240.0, 240.0), 3.5)

BEHIND_MM = 150.0
"""The board stands across the cylinder's axis, so far behind its end."""

AXIS, LEE, WINDWARD = 0.0, -35.0, 35.0
"""Turns of board and camera about the vertical, degrees: seen along the axis, or from one side."""

BOARD_CAMERA = camera_at(
    (400.0, 0.0, 60.0),
    (0.0, 0.0, 60.0),
    focal_length_mm=25.0,
    sensor_mm=(12.0, 12.0),
    resolution=(3000, 3000),
)

DEVICE = iriftrace.Camera(focal_length_mm=25.0, sensor_mm=(8.0, 6.4), resolution=(120, 96))

NOISE_PX = 0.05

FINE = tuple(f"fine/at_0.{w}_from_090" for w in (12, 14, 16, 18))
COARSE = tuple(f"coarse/at_0.{w}_from_090" for w in (12, 14, 16, 18))


@frozen
class Case:
    """Files of the truth and of the members, and from where the boards are seen."""

    truth: str
    members: tuple[str, ...]
    turns: tuple[float, ...] = (AXIS,)
    between: tuple[tuple[int, ...], ...] = ()
    """Further members between others, by these numbers (`iriftrace.field_between`)."""
    part: str = "part.ply"
    still: str = "family/at_0.00"


PAIR, SQUARE = ((0, 1),), ((0, 1), (2, 3), (0, 2), (1, 3), (0, 1, 2, 3))
"""Places between two members, and between those of two speeds and two directions."""

WIDE = ("wide/at_0.12_from_090", "wide/at_0.16_from_090")

TURNED = tuple(f"turned/at_0.{w}_from_{turn}" for turn in ("080", "090") for w in (14, 16))

STUB = tuple(f"stub/at_0.{w}_from_{turn}" for turn in ("075", "090") for w in (12, 16))

OF_STUB = "stub.ply", "stub/still"

CASES = (
    Case("fine/at_0.15_from_090", FINE),
    Case("fine/at_0.13_from_090", FINE),
    Case("fine/at_0.17_from_090", FINE),
    Case("fine/at_0.15_from_090", tuple(f"fine/at_0.{w}_from_090" for w in (12, 13, 17, 18))),
    Case("fine/at_0.15_from_090", COARSE),
    Case("fine/at_0.13_from_090", COARSE),
    Case("fine/at_0.17_from_090", COARSE),
    Case("fine/at_0.15_from_090", COARSE[1:3]),
    Case("wide/at_0.13_from_090", WIDE),
    Case("wide/at_0.13_from_090", WIDE, (AXIS,), PAIR),
    Case("wide/at_0.14_from_090", WIDE),
    Case("wide/at_0.14_from_090", WIDE, (AXIS,), PAIR),
    Case("turned/at_0.15_from_085", TURNED),
    Case("turned/at_0.15_from_085", TURNED, (LEE,)),
    Case("turned/at_0.15_from_085", TURNED, (LEE, WINDWARD)),
    Case("turned/at_0.15_from_085", TURNED, (AXIS,), SQUARE),
    Case("turned/at_0.15_from_085", TURNED, (LEE,), SQUARE),
    Case("turned/at_0.15_from_085", TURNED, (LEE, WINDWARD), SQUARE),
    Case("turned/at_0.15_from_085", tuple(f"turned/at_0.{w}_from_085" for w in (14, 16))),
    Case("stub/at_0.14_from_080", STUB, (AXIS,), (), *OF_STUB),
    Case("stub/at_0.14_from_080", STUB, (LEE,), SQUARE, *OF_STUB),
    Case("stub/at_0.14_from_080", STUB, (LEE, WINDWARD), SQUARE, *OF_STUB),
    Case("strong/field", COARSE),
    Case("second/field", COARSE),
)


def main(folder: str) -> None:
    """Print a row for each case."""
    first, second = (
        DEVICE.at(iriftrace.look_at((x, -283.0, 283.0), (0.0, 0.0, 0.0))) for x in (-75.0, 75.0)
    )
    names = {name for case in CASES for name in (case.truth, case.still, *case.members)}
    fields = {name: iriftrace.read_field(Path(folder) / f"{name}.vtu") for name in sorted(names)}

    for case in CASES:
        part = iriftrace.read_part(Path(folder) / case.part)
        air = iriftrace.HotAir(fields[case.truth])
        family = [fields[name] for name in case.members]
        family += [iriftrace.field_between([family[n] for n in some]) for some in case.between]
        views = [_seen(part, air, family, turn) for turn in case.turns]
        fit = iriftrace.fit_members(*views[0], others=views[1:])
        found = (
            f"{case.truth} by {', '.join(case.members)}, {len(case.between)} between, seen at "
            f"{case.turns} deg: residual "
            f"{fit.ratio:.2f} times the noise"
        )
        true = iriftrace.Scene(part, air, first, second, "camera_2", engine="cells")
        scan = iriftrace.measure(true)
        by_still, _ = _left(scan, evolve(true, air=iriftrace.HotAir(fields[case.still])))
        weighted = iriftrace.HotAir(family, weights=fit.weights)
        left, u = _left(scan, evolve(true, air=weighted))
        assert u is not None
        print(
            f"{found}; measured {_um(scan.error_normal)}, left by still air {_um(by_still)}, by "
            f"the fit {_um(left)} of {len(left) / len(scan.points):.0%} of the points, "
            f"{np.mean(np.abs(left) <= 2.0 * u):.1%} within U",
            flush=True,
        )


def _seen(
    part: iriftrace.Part, air: iriftrace.HotAir, family: list[iriftrace.IndexField], turn: float
) -> tuple[iriftrace.Scene, MeasuredShift]:
    """A board's scene in the air of the members, and the shifts of its dots in the true air."""
    turned = parse_transform(f"rotate z {turn}")
    behind = part.bounds[0, 0] - BEHIND_MM
    to_world = turned @ ((0, 0, 1.0, behind), (1.0, 0, 0, 0), (0, 1.0, 0, 60.0), (0, 0, 0, 1.0))
    camera = BOARD_CAMERA.at(turned @ BOARD_CAMERA.matrix)
    board = BOARD.part.transformed(to_world)
    seen = iriftrace.Scene(board, air, camera, blockers=(part,), engine="cells")
    shifts = measured_shifts(seen, NOISE_PX, board=BOARD, to_world=to_world)
    return evolve(seen, air=iriftrace.HotAir(family)), shifts


def _left(scan: iriftrace.Scan, scene: iriftrace.Scene) -> tuple[FloatArray, FloatArray | None]:
    """Error along the normal of the points that are corrected, mm, and its uncertainty."""
    fixed = iriftrace.correct(scan.points, scene)
    good = fixed.corrected
    left = np.einsum("ij,ij->i", fixed.points - scan.true, scan.normal)[good]
    return left, None if fixed.u_normal is None else fixed.u_normal[good]


def _um(errors: FloatArray) -> str:
    return f"{1e3 * np.sqrt(np.mean(errors**2)):.2g} um"


if __name__ == "__main__":
    warnings.simplefilter("ignore", IriftraceWarning)
    main(*sys.argv[1:])

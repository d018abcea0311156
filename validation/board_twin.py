"""Twin experiment of `iriftrace fit` on a solved family of draughts: the table of docs/board.md.

    iriftrace field simulate part.ply -o family --wall-temperature "1100 degC" \
        --draughts 0.12:0.18:0.01 --draught-from 90 --background-cell "36 mm" --symmetry x
    python -m validation.board_twin part.ply family

The part is `scenes/cylinder/part.ply`. States that are no members are the truth: their traced
shifts get 0.05 px of noise, and the cloud of two devices to the lee is corrected.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import numpy as np
from attrs import evolve

import iriftrace
from iriftrace.core.arrays import FloatArray
from iriftrace.core.errors import IriftraceWarning
from iriftrace.part.shapes.board import Board
from validation.inputs.leaning_air import measured_shifts

BOARD = Board((240.0, 240.0), 3.5)

TO_WORLD = np.array(((0, 0, 1.0, -235.0), (1.0, 0, 0, 0), (0, 1.0, 0, 60.0), (0, 0, 0, 1.0)))
"""The board stands across the cylinder's axis, 150 mm behind its end."""

BOARD_CAMERA = iriftrace.Camera(
    focal_length_mm=25.0,
    sensor_mm=(12.0, 12.0),
    resolution=(3000, 3000),
    matrix=iriftrace.look_at((400.0, 0.0, 60.0), (0.0, 0.0, 60.0)),
)

DEVICE = iriftrace.Camera(focal_length_mm=25.0, sensor_mm=(8.0, 6.4), resolution=(120, 96))

NOISE_PX = 0.05

CASES = (
    (0.15, (0.12, 0.14, 0.16, 0.18)),
    (0.13, (0.12, 0.14, 0.16, 0.18)),
    (0.17, (0.12, 0.14, 0.16, 0.18)),
    (0.15, (0.12, 0.13, 0.17, 0.18)),
)
"""Draught of the truth and of the members, m/s."""


def main(part_file: str, folder: str) -> None:
    """Print a row for each case."""
    part = iriftrace.read_part(part_file)
    board = BOARD.part.transformed(TO_WORLD)
    first, second = (
        DEVICE.at(iriftrace.look_at((x, -283.0, 283.0), (0.0, 0.0, 0.0))) for x in (-75.0, 75.0)
    )

    def air(*speeds: float) -> iriftrace.HotAir:
        return iriftrace.HotAir(
            [iriftrace.read_field(next(Path(folder).glob(f"at_{w:.2f}*.vtu"))) for w in speeds]
        )

    for truth, members in CASES:
        seen = iriftrace.Scene(board, air(truth), BOARD_CAMERA, blockers=(part,), engine="cells")
        shifts = measured_shifts(seen, NOISE_PX, board=BOARD, to_world=TO_WORLD)
        fit = iriftrace.fit_members(evolve(seen, air=air(*members)), shifts)
        true = iriftrace.Scene(part, air(truth), first, second, "camera_2", engine="cells")
        scan = iriftrace.measure(true)
        weighted = evolve(
            true, air=iriftrace.HotAir([s.field for s in air(*members).states], weights=fit.weights)
        )
        fixed = iriftrace.correct(scan.points, weighted)
        good = fixed.status == 0
        left = np.einsum("ij,ij->i", fixed.points - scan.true, scan.normal)[good]
        within = np.mean(np.abs(left) <= 2.0 * fixed.u_normal[good])
        print(
            f"{truth} m/s by {members}: residual {fit.ratio:.2f} times the noise, measured "
            f"{_um(scan.error_normal)}, left {_um(left)}, {within:.1%} within U",
            flush=True,
        )


def _um(errors: FloatArray) -> str:
    return f"{1e3 * np.sqrt(np.mean(errors**2)):.2g} um"


if __name__ == "__main__":
    warnings.simplefilter("ignore", IriftraceWarning)
    main(*sys.argv[1:])

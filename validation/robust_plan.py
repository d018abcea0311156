"""Robust plans over families of draughts: the table of docs/camera_position.md.

    iriftrace field simulate part.ply -o family --wall-temperature "1100 degC" \
        --draughts 0:0.2:0.1 --draught-from 90 --symmetry x --background-cell "44 mm"
    python -m validation.robust_plan part.ply family [part.ply family ...]

The cells of the table are 36 mm (cylinder, from a family up to 0.3 m/s), 44 mm (wishbone) and 30 mm
(gear).

A plan over the family is made once robust and once by the mean, and one in still air alone. A
pose's score in each member's air, on one scale, tells what it is worth there; poses are ranked by
that of their worst member.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path

import numpy as np
from attrs import evolve

import iriftrace
from iriftrace.core.errors import IriftraceWarning
from iriftrace.planning.criteria import Criteria
from iriftrace.planning.rank import ranked_quietly, score_of
from validation.inputs.cameras import camera_at

DISTANCE = 400.0  # mm

CAMERA = camera_at(
    (0.0, -DISTANCE, 0.0), focal_length_mm=16.0, sensor_mm=(8.0, 6.4), resolution=(100, 80)
)

AZIMUTHS, ELEVATIONS = range(0, 360, 30), range(0, 91, 15)

LEAST = 0.5
"""Fraction of the largest coverage of all poses: poses that see less are not ranked."""


def main(part_file: str, folder: str) -> None:
    """Print a row for each plan."""
    part = iriftrace.read_part(part_file)
    files = sorted(Path(folder).glob("at_*.vtu"))
    fields = [iriftrace.read_field(file) for file in files]
    orbit = iriftrace.Orbit(part.centre, np.full(3, DISTANCE))
    poses = iriftrace.orbit_poses(orbit, AZIMUTHS, ELEVATIONS)
    family = iriftrace.Scene(part, iriftrace.HotAir(fields), CAMERA, engine="cells")
    table = iriftrace.run_sweep(family, poses)
    criteria = Criteria(min_coverage=LEAST * float(table["coverage_area"].sel(region="part").max()))
    alone = [
        ranked_quietly(
            iriftrace.run_sweep(evolve(family, air=iriftrace.HotAir(field)), poses), criteria
        )
        for field in fields
    ]
    mean = ranked_quietly(table, evolve(criteria, robust=0.0))
    plans = {"robust": ranked_quietly(table, criteria), "mean": mean, "still air": alone[0]}
    scores = np.array(
        [
            [
                score_of(mean, {name: values[pose] for name, values in member.metrics.items()})
                for pose in mean.order
            ]
            for member in alone
        ]
    ).max(axis=0)
    # Mirror images of a pose count once.
    scores = np.round(scores, 2)
    for name, plan in plans.items():
        azimuth, elevation = (float(table[axis][plan.best]) for axis in ("azimuth", "elevation"))
        errors = [1e3 * member.metrics["displacement"][plan.best] for member in alone]
        rank = 1 + len(np.unique(scores[scores < scores[mean.order == plan.best]]))
        print(
            f"{Path(part_file).stem}, {name}: azimuth {azimuth:.0f}, elevation {elevation:.0f} "
            f"deg, displacement (p95) {', '.join(f'{error:.3g}' for error in errors)} um; "
            f"{rank} of {len(scores)} by the worst member",
            flush=True,
        )


if __name__ == "__main__":
    warnings.simplefilter("ignore", IriftraceWarning)
    for words in zip(sys.argv[1::2], sys.argv[2::2], strict=True):
        main(*words)

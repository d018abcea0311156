"""Does the solver compute right? Three time steps on a tiny mesh with inclined faces tell.

Debian 12's OpenFOAM 1912 is miscompiled: on faces that are not along the axes its buoyant solvers
get velocities of 10,000 m/s in the first steps and die. On meshes along the axes they run.
"""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np

from iriftrace.openfoam import air
from iriftrace.openfoam.case_files import (
    AIR_FILES,
    CONTROL_FILES,
    CORRECTORS,
    START_FILES,
    uniform,
    write_file,
)
from iriftrace.openfoam.commands import OpenFoamError, run_program
from iriftrace.openfoam.installation import SOLVER, Installation, identity
from iriftrace.openfoam.log import read_steps, tail
from iriftrace.whole_file import whole_file

TRIAL_PASSED = ""

# Air that expands at the wall moves at 0.2 m/s in that time, a Courant number of 0.006; garbage
# makes hundreds of it.
_END, _STEP = 3e-4, 6e-5
_LARGEST_COURANT = 0.5
# A sheared cube with an edge of 20 mm: no face of it but the lowest lies along an axis.
_CUBE = np.array([(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]) * 20.0
_SHEAR = np.array([[1.0, 0.2, 0.3], [0.3, 1.0, 0.2], [0.2, 0.3, 1.0]])
_PATCHES = (
    ("part", "wall", "(0 3 2 1)"),
    ("sides", "patch", "(0 4 7 3) (0 1 5 4) (1 2 6 5) (3 7 6 2)"),
    ("top", "patch", "(4 5 6 7)"),
)


def try_solver(installation: Installation) -> str:
    """Run the solver for three steps; a solver that has passed once is not tried again.

    Returns
    -------
    str
        What is wrong, or `TRIAL_PASSED`.
    """
    passed = _passed_file(installation)
    if passed.is_file():
        return TRIAL_PASSED
    with tempfile.TemporaryDirectory(prefix="iriftrace-trial-") as name:
        verdict = _trial(installation, Path(name))
    if verdict == TRIAL_PASSED:
        # Where nothing may be written the next call tries again.
        with suppress(OSError):
            passed.parent.mkdir(parents=True, exist_ok=True)
            with whole_file(passed) as temporary:
                temporary.write_text(f"{installation.solver}\n")
    return verdict


def _trial(installation: Installation, folder: Path) -> str:
    write_trial(folder)
    run_program(installation, folder, "blockMesh")
    try:
        log = run_program(installation, folder, SOLVER)
    except OpenFoamError:
        return "it stopped in the first time steps on a mesh with inclined faces"
    return judge(tail(log))


def judge(log: str) -> str:
    """What the solver's log shows: `TRIAL_PASSED`, or what is wrong."""
    steps = read_steps(log)
    if steps.last is None or steps.last < 0.99 * _END or not len(steps.courant):
        return "it did not finish three time steps on a mesh with inclined faces"
    if not steps.courant.max() < _LARGEST_COURANT:
        return (
            "on a mesh with inclined faces still air moved at a Courant number of "
            f"{steps.courant.max():.3g} instead of about 0.01"
        )
    return TRIAL_PASSED


def write_trial(folder: Path) -> None:
    """Write the tiny case."""
    for name in ("0", "constant", "system"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    entries = {
        **air.entries(),
        "ambient_k": 293.15,
        "pressure_pa": 101325.0,
        "symmetry_planes": "",
        "outlet_level": 0.03,
        "wall": uniform(1373.15),
        "corners": (_CUBE @ _SHEAR.T).round(6).tolist(),
        "cells": (5, 5, 5),
        "patches": [{"name": n, "type": t, "faces": f} for n, t, f in _PATCHES],
        "start_time": 0,
        "end_time": _END,
        "write_interval": _END,
        "times_kept": 1,
        "first_step": _STEP,
        "averaging": False,
        "probes": [(0.015, 0.015, 0.015)],
        **CORRECTORS,
    }
    for file in (*AIR_FILES, *START_FILES, *CONTROL_FILES, "system/blockMeshDict"):
        write_file(folder, file, entries)


def _passed_file(installation: Installation) -> Path:
    """Says by its presence that this very program has passed."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "iriftrace" / "openfoam" / f"{identity(installation.solver)}.passed"

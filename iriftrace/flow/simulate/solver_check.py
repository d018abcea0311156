"""Test of the installed solver, which may be miscompiled.

The test takes three time steps on a tiny mesh with inclined faces. Debian 12's OpenFOAM 1912 is
miscompiled: on faces that are not along the axes its buoyant solvers get velocities of 10,000 m/s
in the first steps and stop. On meshes along the axes they run. In a clone of the
repository ``make openfoam`` builds a repaired one, which `find_openfoam` then prefers.
"""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path

import numpy as np

from iriftrace.core.files import sha256_of, write_whole
from iriftrace.flow.simulate.case_files import (
    AIR_FILES,
    CONTROL_FILES,
    CORRECTORS,
    COURANT,
    START_FILES,
    gas_entries,
    uniform,
    write_file,
)
from iriftrace.flow.simulate.programs import (
    SOLVER,
    Installation,
    OpenFoamError,
    courant_numbers,
    run_program,
    step_times,
    tail,
)

# Air that expands at the wall moves at 0.2 m/s in that time, a Courant number of 0.006; wrong
# velocities give hundreds.
_END, _STEP = 3e-4, 6e-5
_LARGEST_COURANT = 0.5
# A sheared cube with an edge of 20 mm: only its lowest face lies along an axis.
_CUBE = np.array([(x, y, z) for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]) * 20.0
_SHEAR = np.array([[1.0, 0.2, 0.3], [0.3, 1.0, 0.2], [0.2, 0.3, 1.0]])
_PATCHES = (
    ("part", "wall", "(0 3 2 1)"),
    ("sides", "patch", "(0 4 7 3) (0 1 5 4) (1 2 6 5) (3 7 6 2)"),
    ("top", "patch", "(4 5 6 7)"),
)


def try_solver(installation: Installation) -> str:
    """Run the solver for three steps unless it has passed before: what is wrong, or ""."""
    # Exists if this very program has passed.
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    digest = sha256_of(Path(installation.solver))
    passed = Path(cache) / "iriftrace" / "openfoam" / f"{digest}.passed"
    if passed.is_file():
        return ""
    with tempfile.TemporaryDirectory(prefix="iriftrace-trial-") as name:
        folder = Path(name)
        write_trial(folder)
        run_program(installation, folder, "blockMesh")
        try:
            verdict = judge(tail(run_program(installation, folder, SOLVER)))
        except OpenFoamError:
            verdict = "it stopped in the first time steps on a mesh with inclined faces"
    if not verdict:
        # In a read-only folder the next call tests again.
        with suppress(OSError):
            passed.parent.mkdir(parents=True, exist_ok=True)
            write_whole(passed, f"{installation.solver}\n")
    return verdict


def judge(log: str) -> str:
    """What is wrong according to the solver's log; "" if nothing is."""
    times, courant = step_times(log), courant_numbers(log)
    if not len(times) or times[-1] < 0.99 * _END or not len(courant):
        return "it did not finish three time steps on a mesh with inclined faces"
    if not courant.max() < _LARGEST_COURANT:
        return (
            "on a mesh with inclined faces still air moved at a Courant number of "
            f"{courant.max():.3g} instead of about 0.01"
        )
    return ""


def write_trial(folder: Path) -> None:
    for name in ("0", "constant", "system"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    entries = {
        **gas_entries(),
        "ambient_k": 293.15,
        "pressure_pa": 101325.0,
        "symmetry_planes": "",
        "inlets": [],
        "walls": [],
        "free": ["sides", "top"],
        "draught": (0, 0, 0),
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
        "courant": COURANT,
        "averaging": False,
        "probes": [(0.015, 0.015, 0.015)],
        **CORRECTORS,
    }
    for file in (*AIR_FILES, *START_FILES, *CONTROL_FILES, "system/blockMeshDict"):
        write_file(folder, file, entries)

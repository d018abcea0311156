"""Cases that say what an input changes: another case, solved again with that input a step higher.

They use that one's mesh and times, so that differences between both fields come from the input
alone, also where the mesh is coarse.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import get_args

from attrs import evolve

from iriftrace.core.errors import InputError
from iriftrace.core.files import sha256_of
from iriftrace.core.units import named_quantities
from iriftrace.flow.simulate.case import Case
from iriftrace.flow.simulate.programs import Installation
from iriftrace.flow.simulate.simulate import Display, Simulation, simulate
from iriftrace.medium.source import Variation, VariedInput

_UNITS: Mapping[VariedInput, str] = {"wall": "K", "ambient": "K", "pressure": "pascal"}


def varied_cases(case: Case, text: str) -> tuple[Case, ...]:
    """A case with each of the inputs in ``"wall 10 K, ambient 2 K, pressure 2 hPa"`` changed.

    Raises InputError for text that does not say so, a step that is not positive, and a case that
    cannot be simulated.
    """
    try:
        steps = named_quantities(text, {str(name): unit for name, unit in _UNITS.items()})
        if not steps:
            raise ValueError('there is none; write them like "wall 10 K"')
        if not all(0.0 < step < math.inf for step in steps.values()):
            raise ValueError('a step is not positive; write it like "wall 10 K"')
    except ValueError as error:
        raise InputError(
            f"Among the inputs to change {error}.", code="case.steps_not_read", argument="vary"
        ) from None
    return tuple(
        _changed(case, Variation(name, steps[name], of=""))
        for name in get_args(VariedInput)
        if name in steps
    )


def case_folder(varied: Case, folder: Path) -> Path:
    """Folder of a varied case in that of the case that it varies."""
    return folder / "vary" / _variation(varied).quantity


def solve_varied(
    varied: Case, folder: Path, first: Simulation, installation: Installation, display: Display
) -> Simulation:
    """Solve a varied case that was prepared, and write its field, ``NAME_wall.vtu``.

    `folder` and `first` are those of the case that it varies. The field is written next to it and
    averaged over the same time, even if that is shorter than requested.
    """
    file = first.field
    variation = evolve(_variation(varied), of=sha256_of(file))
    times = evolve(varied.times, averaging=first.averaged)
    return simulate(
        evolve(varied, variation=variation, times=times),
        case_folder(varied, folder),
        file.with_name(f"{file.stem}_{variation.quantity}.vtu"),
        installation,
        display,
        like=folder,
    )


def _changed(case: Case, variation: Variation) -> Case:
    step, name, options = variation.step, variation.quantity, case.options
    return evolve(
        case,
        wall=case.wall.hotter(step if name == "wall" else 0.0),
        options=evolve(
            options,
            ambient=options.ambient + (step if name == "ambient" else 0.0),
            pressure=options.pressure + (step if name == "pressure" else 0.0),
        ),
        times=evolve(case.times, snapshots=0),
        variation=variation,
    )


def _variation(varied: Case) -> Variation:
    assert varied.variation is not None
    return varied.variation

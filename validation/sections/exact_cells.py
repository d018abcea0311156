"""The cells engine against media whose rays are known in closed form."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from iriftrace.scenes.closed_forms import CYLINDER_UM, SLAB_SHIFT_UM
from validation.curves import draw_convergence
from validation.inputs.hot_air import (
    cylinder_ends,
    cylinder_grid,
    cylinder_values,
    on_cells,
    slab_ends,
    slab_grid,
    slab_values,
)
from validation.line import Line, Section, relative
from validation.oracles.media import (
    AIR_PARABOLA_UM,
    Launch,
    end_error,
    launches,
    parabola,
    walk,
)

STEPS = (16, 32, 64, 128)
PICTURE = "cells.png"
FINE_STEPS = 2000
END_BOUND = {"Luneburg lens": 1e-8, "Maxwell fish-eye": 1e-5, "parabolic rod": 1e-9}
"""Relative error of the end after 64 steps (ten times as many in the rod)."""

ORDER, ORDER_BOUND = 4, 0.2

FORMULA_BOUND, CELLS_BOUND = 0.01, 0.5
"""Per cent."""


def convergence(name: str, launch: Launch, errors: dict[int, float]) -> list[Line]:
    """End after 64 steps, and the slope of the error over the number of steps."""
    order = -float(np.polyfit(np.log(STEPS), np.log(list(errors.values())), 1)[0])
    return [
        Line(
            f"{name}, {64 * launch.division} steps: end, relative",
            "0",
            f"{errors[64]:.2e}",
            errors[64],
            END_BOUND[name],
            "",
        ),
        Line(
            f"{name}: order fitted from {STEPS[0] * launch.division} to "
            f"{STEPS[-1] * launch.division} steps",
            f"{ORDER}",
            f"{order:.2f}",
            # A higher order is not an error.
            max(0.0, ORDER - order),
            ORDER_BOUND,
            "",
        ),
    ]


def conservation(name: str, launch: Launch) -> list[Line]:
    """Speed along the path, and the path back."""
    there = walk(launch.medium, launch.start, launch.velocity, launch.time, FINE_STEPS)
    back = walk(launch.medium, there.end, -there.velocity, launch.time, FINE_STEPS)
    off = float(np.linalg.norm(back.end - launch.start))
    size = float(np.linalg.norm(launch.end - launch.start))
    return [
        Line(
            f"{name}, {FINE_STEPS} steps: largest difference of speed and index, relative",
            "0",
            f"{there.drift:.1e}",
            there.drift,
            1e-9,
            "",
        ),
        Line(
            f"{name}, {FINE_STEPS} steps there and back: miss at the start, relative",
            "0",
            f"{off / size:.1e}",
            off / size,
            1e-9,
            "",
        ),
    ]


def parabolas() -> list[Line]:
    """One step each, because every step integrates a constant acceleration exactly."""
    lines = []
    for length, height_um in AIR_PARABOLA_UM.items():
        launch = parabola(length)
        found = walk(launch.medium, launch.start, launch.velocity, launch.time, 1)
        lines.append(
            relative(
                f"linear n², one step of {length} mm: height",
                height_um,
                float(found.end[1] * 1e3),
                "µm",
                2e-6,
            )
        )
    return [*lines, *conservation("linear n², 500 mm", parabola(500))]


def hot_air(folder: Path) -> list[Line]:
    """Slab and cylinder, by the formula and on cells with either kind of gradient."""
    ways = {
        "formula": (None, None, FORMULA_BOUND),
        "cells, recovered gradient": (
            on_cells(slab_grid(), slab_values, recovered=True),
            on_cells(cylinder_grid(), cylinder_values, recovered=True),
            CELLS_BOUND,
        ),
        "cells, constant gradient": (
            on_cells(slab_grid(), slab_values, recovered=False),
            on_cells(cylinder_grid(), cylinder_values, recovered=False),
            CELLS_BOUND,
        ),
    }
    lines = []
    for way, (in_slab, in_cylinder, bound) in ways.items():
        ends, straight = slab_ends(folder, in_slab)
        shifts = (ends.point - straight)[:, 0] * 1e3
        lines += [
            relative(f"slab as {way}, {angle}°: shift", exact, um, "µm", bound)
            for (angle, exact), um in zip(SLAB_SHIFT_UM.items(), shifts.tolist(), strict=True)
        ]
        ends, straight = cylinder_ends(folder, in_cylinder)
        found = np.linalg.norm(ends.point - straight, axis=1) * 1e3
        lines += [
            relative(f"hot cylinder as {way}, ray at {b:g} R: displacement", exact, um, "µm", bound)
            for (b, exact), um in zip(CYLINDER_UM.items(), found.tolist(), strict=True)
        ]
    return lines


def _lines(folder: Path) -> list[Line]:
    lines, curves = [], {}
    for name, launch in launches().items():
        errors = {steps: end_error(launch, steps) for steps in STEPS}
        lines += [*convergence(name, launch, errors), *conservation(name, launch)]
        curves[name] = [steps * launch.division for steps in STEPS], list(errors.values())
    panels = {"Cells engine, error of the end": curves}
    draw_convergence(folder / PICTURE, panels, "number of steps", "relative error", ORDER)
    return [*lines, *parabolas(), *hot_air(folder)]


SECTION = Section(
    "cells",
    "Cells engine against exact solutions",
    "The engine's own step in media whose rays have closed forms: the Luneburg lens (n² = 2 - r², "
    "a ray at half the radius, to the focus), Maxwell's fish-eye (from a point to its image), a "
    "parabolic rod (n² = 2.25 (1 - 0.01 y²), 100 mm of the parameter) and air with n² linear in y. "
    "The speed (index times direction) must be the index along the whole path, and the path back "
    "must end at the start. Then slab and hot cylinder of the section above, once as formulas in "
    "steps of 0.02 mm, once on tetrahedra (80 and 100 layers of cells) with either kind of "
    "gradient.",
    _lines,
    picture=PICTURE,
)

"""The commands ``iriftrace field ...``: making, judging and looking into temperature fields."""

from __future__ import annotations

from cyclopts import App

from iriftrace.cli.commands_by_name import add_command

field = App(
    name="field",
    help="Make a temperature field for a part, or check one.",
    help_format="rst",
)

for _by_name in (
    (
        "simulate_commands",
        "simulate",
        "Simulate the hot air around a part with OpenFOAM and write the field.",
        'part.stl -o case --wall-temperature "1100 degC" --resolution coarse',
    ),
    (
        "simulate_commands",
        "doctor",
        "Find OpenFOAM on this machine and test whether its solvers compute right.",
        "",
    ),
    (
        "synthetic_commands",
        "synthetic",
        "Write a synthetic boundary layer and plume around a part, for tests and quick looks.",
        "part.ply -o field.vtu",
    ),
    (
        "field_check_commands",
        "check",
        "Check a field against its part: wall, boundary layer, heat balance, gradients.",
        "field.vtu part.ply",
    ),
):
    add_command(field, "iriftrace field", *_by_name)

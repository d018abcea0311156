"""The command ``iriftrace twin``: repeats of a real measurement against simulated ones."""

from __future__ import annotations

from pathlib import Path

from iriftrace.cli import checks
from iriftrace.cli.console import print_table, say
from iriftrace.cli.options import Output
from iriftrace.core.units import Length

NO_LENGTH = Length(0.0)


def twin(
    real: Path,
    simulated: Path,
    *,
    calibration_uncertainty: Length = NO_LENGTH,
    other_uncertainty: Length = NO_LENGTH,
    output: Output | None = None,
) -> None:
    """Compare repeats of a real measurement with simulated ones: does the simulation hold?

    Both tables (.csv) have a column for each feature, with its unit as in "bore [mm]", and a row
    for each repeat. A feature passes if the normalised error E is below 1 and the simulation is not
    only vague. Until a real part has passed, U rests on the program's own model.

    Example: ``iriftrace twin real.csv simulated.csv --calibration-uncertainty "1 um"``

    Parameters
    ----------
    real
        Repeats of the real measurement.
    simulated
        Repeats of the simulated one.
    calibration_uncertainty
        Standard uncertainty of the sensor's calibration.
    other_uncertainty
        Standard uncertainty of the real measurement by all else.
    output
        The numbers, .json; by default they are only printed.
    """
    from iriftrace.core.files import write_json
    from iriftrace.io.repeats import read_repeats
    from iriftrace.measuring.uncertainty.twin import compare_twin

    checks.inputs(real, simulated)
    checks.output(output, "twin.json")
    found = compare_twin(
        read_repeats(real),
        read_repeats(simulated),
        u_cal_mm=calibration_uncertainty,
        u_b_mm=other_uncertainty,
    )
    print_table(
        None,
        ("feature", "real (mm)", "simulated (mm)", "E", "vagueness (< 2)", "verdict"),
        [
            (
                one.feature,
                f"{one.real:.4f}",
                f"{one.simulated:.4f}",
                f"{one.e:.2f}",
                f"{one.vagueness:.2f}",
                "passes" if one.passes else "fails",
            )
            for one in found
        ],
        texts=["feature"],
    )
    passed = sum(one.passes for one in found)
    say(f"The twin passes for {passed} of {len(found)} features.")
    if output is not None:
        write_json(output, {"schema": SCHEMA, "features": [one.as_dict() for one in found]})
        say(f"Files: {output}")


SCHEMA = "iriftrace.twin/1"
"""Value of ``schema`` in the JSON."""

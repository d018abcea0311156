"""Options of the uncertainty of a result, for Python and for commands."""

from __future__ import annotations

from typing import TYPE_CHECKING

from attrs import frozen

if TYPE_CHECKING:
    from iriftrace.measuring.uncertainty.decision import Tolerance
    from iriftrace.measuring.uncertainty.inputs import Inputs


@frozen
class AnswerOptions:
    """What is known of the inputs, and what is asked of the features.

    Parameters
    ----------
    uncertainty
        Standard uncertainties of the inputs, "wall 10 K, ambient 2 K, pressure 2 hPa, sensor 8 um";
        further ones: air, mesh and numerics (fractions of the air's effect, "5 %"), humidity,
        expansion (a fraction), part (K), position and rotation of each device (a length, an angle),
        other (a length); and states, the number of states of unsteady air that are averaged.
    tolerance
        Tolerance of a diameter, "cylinder:bore=20.22 -0.02 +0.02 mm", by which it is accepted or
        rejected; repeatable.
    """

    uncertainty: str = ""
    tolerance: list[str] | None = None

    @property
    def inputs(self) -> Inputs:
        """The uncertainties; raises InputError for a text that does not state them."""
        from iriftrace.measuring.uncertainty.inputs import Inputs

        return Inputs.of(self.uncertainty)

    @property
    def tolerances(self) -> dict[str, Tolerance]:
        """Tolerances by the names of features; raises InputError for other texts."""
        from iriftrace.measuring.uncertainty.tolerances import tolerances_of

        return tolerances_of(self.tolerance or ())


NOTHING_ASKED = AnswerOptions()

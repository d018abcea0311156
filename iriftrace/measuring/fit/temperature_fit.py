"""Weights of an ensemble's members from temperatures that thermocouples measured in the air."""

from __future__ import annotations

import numpy as np

from iriftrace.core.errors import InputError
from iriftrace.core.statistics import rms
from iriftrace.io.air_temperatures import AirTemperatures
from iriftrace.measuring.fit.member_fit import (
    INDISTINCT,
    FittedView,
    MemberFit,
    check_count,
    fitted_places,
    member_fit,
    members_in,
)
from iriftrace.measuring.fit.shift_mixture import ShiftMixture
from iriftrace.tracing.provenance import provenance
from iriftrace.tracing.scene import Scene, ready_scene


def fit_temperatures(scene: Scene, temperatures: AirTemperatures) -> MemberFit:
    """Fit the weights of an ensemble's members to temperatures of the air.

    Each temperature is weighted by its own uncertainty; residual and noise are in K of their root
    mean square.

    Parameters
    ----------
    scene : Scene
        An ensemble of fields; its part and camera do not matter.
    temperatures : AirTemperatures
        In the scene's frame (:func:`iriftrace.read_air_temperatures`).

    Raises
    ------
    InputError
        The scene is not an ensemble or has no fields; places lie in its part; there are fewer
        temperatures than members; or the members hardly differ there.
    """
    loaded = ready_scene(scene)
    members = members_in(loaded)
    fitted = fitted_places(members)
    check_count(len(temperatures.places), len(fitted), "thermocouples")
    inside = loaded.part.surface.inside(temperatures.places)
    if inside.any():
        raise InputError(
            f"{inside.sum()} of {len(inside)} thermocouples in {temperatures.origin.path} lie "
            "inside the part, where there is no air; give places in mm in the frame of "
            "the scene, or leave them out.",
            code="thermocouples.inside_part",
        )
    states = [loaded.air.states[place].cells for place in fitted]
    ambient = states[0].air.temperature_k
    # Excess over the ambient air: the covariance scales it as a whole.
    predicted = np.array([cells.temperature_at(temperatures.places) for cells in states]) - ambient
    measured = temperatures.kelvins - ambient
    noise = rms(temperatures.deviations)
    factor = noise / temperatures.deviations
    spread = rms((factor * (predicted - predicted.mean(axis=0))).ravel())
    if spread < INDISTINCT * noise:
        raise InputError(
            f"The members' temperatures differ by {spread:.2g} K at the thermocouples, less than a "
            f"tenth of their uncertainty of {noise:.2g} K, so weights cannot be determined; place "
            "thermocouples in the plume.",
            code="fit.indistinct",
        )
    found = ShiftMixture((factor * predicted)[:, :, None], (factor * measured)[:, None])
    return member_fit(
        members,
        found,
        noise,
        noise_source="uncertainties of the temperatures",
        unit="K",
        measured=rms(measured),
        dots={"measured": len(factor)},
        views=(FittedView(temperatures.origin, found.residual, noise),),
        provenance=provenance(loaded, loaded.camera),
    )

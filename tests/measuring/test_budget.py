"""Budgets against closed forms, GTC and plain Monte Carlo; verdicts against the normal tables."""

from __future__ import annotations

import json
import math

import GTC
import numpy as np
import pytest
from attrs import evolve
from scipy.special import gammaincinv
from scipy.stats import norm, sobol_indices

from iriftrace.core.errors import InputError
from iriftrace.core.member_weights import MemberWeights
from iriftrace.measuring.features.quantity import Quantity
from iriftrace.measuring.two_devices.decided import decided
from iriftrace.measuring.uncertainty.air_groups import AIR, AirGroups, Scaled, SolvedAgain
from iriftrace.measuring.uncertainty.budget import (
    COVERED,
    Contribution,
    Mixture,
    Uncertainty,
    drawn,
    half_a_digit,
    uncertainty_of,
)
from iriftrace.measuring.uncertainty.decision import Decision, Tolerance, decide
from iriftrace.measuring.uncertainty.inputs import Inputs
from iriftrace.measuring.uncertainty.similarity import humidity_effect, relative_effects
from iriftrace.medium.air.refractivity import Air

HOT_K = 1373.15


def test_a_linear_budget_is_that_of_gtc() -> None:
    """A diameter by air, sensor and growth; GTC propagates the same inputs by itself."""
    air, sensor = GTC.ureal(0.020, 0.003), GTC.ureal(20.21, 0.0007)
    scale = GTC.ureal(0.0, 0.002, 12)
    diameter = sensor - air * 1.1 + 20.0 * scale
    found = uncertainty_of(
        diameter.x,
        [
            Contribution("air", 1.1 * 0.003),
            Contribution("sensor", 0.0007),
            Contribution("scale", 20.0 * 0.002),
        ],
    )
    assert found.standard == pytest.approx(diameter.u, rel=1e-9)
    assert found.expanded == pytest.approx(2.0 * diameter.u, rel=1e-9)
    assert [one.group for one in found.contributions] == ["scale", "air", "sensor"]
    assert sum(map(found.share, found.contributions)) == pytest.approx(1.0)


@pytest.mark.parametrize("normal", [0.0, 0.4, 5.0])
@pytest.mark.parametrize(
    ("weights", "values"),
    [
        ((0.5, 0.5), (0.0, 3.0)),
        ((0.2, 0.3, 0.5, 0.0), (-0.4, 0.1, 2.0, 50.0)),
        ((1 / 6,) * 6, range(6)),
    ],
)
def test_air_between_members_is_that_of_plain_draws(
    normal: float, weights: tuple[float, ...], values: tuple[float, ...]
) -> None:
    """Against a million independent draws of NumPy's Dirichlet and normal generators."""
    w, x = np.array(weights), np.array(values, dtype=np.float64)
    used, rng = w > 0.0, np.random.default_rng(4)
    shares = rng.dirichlet(2.0 / (used.sum() - 1.0) * w[used], 1_000_000)
    plain = shares @ x[used] - w @ x + normal * rng.normal(size=len(shares))
    u_air = MemberWeights(w).uncertainty(x)
    assert u_air == pytest.approx((shares @ x[used]).std(), rel=3e-3)
    parts = [Contribution(AIR, float(u_air)), Contribution("rest", normal)]
    found = uncertainty_of(7.0, parts, Mixture(AIR, w, x))
    assert found.standard == pytest.approx(plain.std(), rel=3e-3)
    ends = np.quantile(plain, (0.5 * (1 - COVERED), 0.5 * (1 + COVERED)))
    np.testing.assert_allclose(np.array(found.interval) - 7.0, ends, atol=0.01 * ends[1])
    assert 1.0 < found.coverage_factor < 2.6


def test_what_scales_the_air_scales_the_state_that_it_is_in() -> None:
    """Against plain draws of the product; the interval is wider than by its variance alone."""
    w, x = np.full(4, 0.25), np.array((0.0, -1.0, -2.0, -40.0))
    mixture = Mixture(AIR, w, x, ("mesh", "contrast"), math.hypot(0.3, 0.4))
    u_air = float(MemberWeights(w).uncertainty(x))
    by_scale = math.hypot(float(w @ x), u_air)
    parts = [Contribution(AIR, u_air), Contribution("sensor", 0.5)]
    parts += [Contribution("mesh", 0.3 * by_scale), Contribution("contrast", 0.4 * by_scale)]
    found = uncertainty_of(7.0, parts, mixture)
    rng = np.random.default_rng(8)
    effect = rng.dirichlet(2.0 / 3.0 * w, 2_000_000) @ x
    plain = effect * (1.0 + 0.5 * rng.normal(size=len(effect))) - w @ x
    plain += 0.5 * rng.normal(size=len(effect))
    assert found.standard == pytest.approx(plain.std(), rel=3e-3)
    ends = np.quantile(plain, (0.5 * (1 - COVERED), 0.5 * (1 + COVERED)))
    np.testing.assert_allclose(np.array(found.interval) - 7.0, ends, atol=0.01 * np.ptp(ends))
    assert found.expanded > 2.2 * found.standard
    for lower in (-30.0, -50.0, -70.0):
        outside = decide(Tolerance(7.0, lower, 1000.0), found).outside
        assert outside == pytest.approx(np.mean(plain < lower), abs=3e-3)
    again = Uncertainty.of(json.loads(json.dumps(found.as_dict("mm"))), "mm")
    assert decide(Tolerance(7.0, -50.0, 1000.0), again).outside == pytest.approx(
        decide(Tolerance(7.0, -50.0, 1000.0), found).outside
    )


@pytest.mark.parametrize("members", [2, 5, 40])
def test_air_in_equal_steps_lies_anywhere_between_them(members: int) -> None:
    """The variance is that of a uniform distribution, whatever the number of members."""
    steps, even = np.linspace(-1.0, 1.0, members), np.full(members, 1.0 / members)
    assert MemberWeights(even).uncertainty(steps) == pytest.approx(1.0 / math.sqrt(3.0))
    change, u, _ = drawn(0.0, Mixture(AIR, even, steps), 2**13)
    assert not u.any()
    assert change.std() == pytest.approx(1.0 / math.sqrt(3.0), rel=0.01)


def test_the_interval_is_known_to_half_a_digit() -> None:
    mixture = Mixture(AIR, np.array((0.5, 0.5)), np.array((0.0, 3.0)))
    change, u, z = drawn(0.4, mixture, 2**11)
    ends = np.quantile(change + u * z, 0.977, axis=1)
    assert 2.0 * ends.std(ddof=1) / math.sqrt(len(ends)) < half_a_digit(ends.mean())
    assert half_a_digit(0.0123) == pytest.approx(0.0005)


def test_shares_are_sobol_indices() -> None:
    """Terms add up, so the fraction of the variance is the first-order index of a group."""
    x, even = np.array((0.0, 1.0, 4.0)), np.full(3, 1 / 3)
    u = float(MemberWeights(even).uncertainty(x))
    found = uncertainty_of(0.0, [Contribution(AIR, u), Contribution("rest", 0.5)])

    def model(units: np.ndarray) -> np.ndarray:
        gammas = gammaincinv(1 / 3, units[:3])
        return ((gammas / gammas.sum(axis=0)).T @ x + 0.5 * norm.ppf(units[3]))[None]

    a, b = np.random.default_rng(2).uniform(size=(2, 4, 2**16))
    mixed = []
    for rows in (slice(0, 3), slice(3, 4)):
        ab = a.copy()
        ab[rows] = b[rows]
        mixed.append(model(ab))
    runs = {"f_A": model(a), "f_B": model(b), "f_AB": np.array(mixed)}
    indices = sobol_indices(func=runs, n=2**16)
    shares = [found.share(one) for one in found.contributions]
    np.testing.assert_allclose(indices.first_order.ravel(), shares, atol=0.01)


def test_groups_scale_or_vary_the_effect() -> None:
    """Two members, the first of them solved again with the wall 20 K hotter."""
    weights = MemberWeights((0.5, 0.5, 0.0))
    groups = AirGroups(
        weights,
        {"mesh": Scaled(0.02, "stated")},
        {"wall": SolvedAgain(np.array((-0.5, 0.0, 0.5)), "solved again")},
        "2 members, any state like them or between",
    )
    values = np.array([[1.0, -2.0], [3.0, -2.0], [1.4, -2.2]])
    parts = groups.parts(weights.mean(values), values)
    # Of the real air's effect, not of the mean's alone.
    np.testing.assert_allclose(parts["mesh"], (0.02 * math.sqrt(4.0 + 1.0 / 3.0), 0.04))
    np.testing.assert_allclose(parts["wall"], (0.2, 0.1))
    # Uniform between 1 and 3.
    np.testing.assert_allclose(parts[AIR], (2.0 / math.sqrt(12.0), 0.0), atol=1e-12)
    np.testing.assert_allclose(
        groups.total(weights.mean(values), values), np.sqrt(sum(u**2 for u in parts.values()))
    )


def test_similarity_is_that_of_plates_solved_again() -> None:
    """Ostrach's layer with real properties, 1100 degC: +0.98, -1.67, +1.19 %."""
    steps = Inputs(pressure_pa=2000.0, ambient_k=5.0, wall_k=20.0)
    found = relative_effects(steps, HOT_K, Air())
    assert found["pressure"] == pytest.approx(0.0098, rel=0.01)
    assert found["ambient"] == pytest.approx(-0.0167, rel=0.1)
    assert found["wall"] == pytest.approx(0.0119, rel=0.2)
    # Ciddor: moist air of 20 degC has 3e-8 less for each 10 %.
    assert humidity_effect(0.1, Air()) == pytest.approx(-0.0003, rel=0.2)
    # To first order, also where the range of the humidity ends.
    assert humidity_effect(0.3, Air(relative_humidity=1.0)) == pytest.approx(-0.0009, rel=0.2)
    # The effect of a wall that may be as cool as the room is not refused.
    assert relative_effects(Inputs(ambient_k=30.0), 313.15, Air())["ambient"] < -1.0


@pytest.mark.parametrize(
    ("value", "verdict", "outside"),
    [
        (20.00, "accepted", 2 * norm.cdf(-5.0)),
        (20.033, "accepted", norm.cdf(-1.7)),
        (20.034, "not decided", norm.cdf(-1.6)),
        (20.066, "not decided", norm.cdf(1.6)),
        (20.067, "rejected", norm.cdf(1.7)),
        (19.90, "rejected", norm.cdf(5.0)),
    ],
)
def test_a_guard_band_of_165_u_keeps_the_risk_below_5_percent(
    value: float, verdict: str, outside: float
) -> None:
    found = decide(
        Tolerance(20.0, -0.05, 0.05), uncertainty_of(value, [Contribution("all", 0.01)]), 20.2
    )
    assert found.verdict == verdict
    assert found.outside == pytest.approx(outside, abs=1e-6)
    assert found.measured is False
    if verdict == "not decided":
        assert found.risk is None
    else:
        assert found.risk is not None
        assert found.risk <= 0.05


def test_the_probability_of_a_mixture_is_that_of_its_own_distribution() -> None:
    """Uniform between 0 and 10: a tenth lies above 9, and a normal one has 8 %."""
    mixture = Mixture(AIR, np.array((0.5, 0.5)), np.array((0.0, 10.0)))
    value = uncertainty_of(5.0, [Contribution(AIR, 10.0 / math.sqrt(12.0))], mixture)
    found = decide(Tolerance(5.0, -6.0, 4.0), value)
    assert found.outside == pytest.approx(0.1, abs=2e-3)


def test_a_saved_correction_is_decided_as_the_value_was() -> None:
    """Also by the distribution of the air, of which half of U does not know."""
    mixture = Mixture(AIR, np.array((0.5, 0.0, 0.5)), np.array((0.0, 7.0, 10.0)))
    u = uncertainty_of(5.0, [Contribution(AIR, 10.0 / math.sqrt(12.0))], mixture)
    size = Quantity("mm", {"measured": 4.0, "corrected": 5.0}, {"measured": 0.1, "corrected": 0.1})
    row = {
        "kind": "cylinder",
        "region": "bore",
        "size_mm": size.by_cloud,
        "u_size_mm": size.u,
        **evolve(size, uncertainty=u).statements(),
    }
    values = json.loads(json.dumps({"features": [row]}))
    tolerance = Tolerance(5.0, -6.0, 4.6)
    (found,) = decided(values, {"cylinder:bore": tolerance})["features"]
    assert Decision.of(found["decision"]) == decide(tolerance, u, 4.0)
    assert found["decision"]["verdict"] == "accepted"
    assert "decision" not in decided({"features": [found]}, {})["features"][0]
    with pytest.raises(InputError, match="bolt"):
        decided(values, {"cylinder:bolt": tolerance})


def test_nothing_is_decided_with_a_lower_bound() -> None:
    least = uncertainty_of(20.0, [Contribution("sensor", 1e-4)], missing=(AIR,))
    found = decide(Tolerance(20.0, -0.05, 0.05), least)
    assert (found.verdict, found.risk) == ("not decided", None)
    assert AIR in found.reason


def test_inputs_are_read_as_users_write_them() -> None:
    found = Inputs.of("wall 10 K, ambient 2 K,pressure 2 hPa, sensor 8 um, air 5 %, mesh 0.02")
    assert found == Inputs(
        wall_k=10.0, ambient_k=2.0, pressure_pa=200.0, sensor_mm=0.008, air=0.05, mesh=0.02
    )
    assert found.stated()["pressure"] == 200.0
    assert Inputs.of("") == Inputs()
    found = Inputs.of("states 20, position 50 um, rotation 0.1 mrad, air 3 %, mesh 4 %")
    assert (found.states, found.position_mm) == (20.0, pytest.approx(0.05))
    assert found.rotation_rad == pytest.approx(1e-4)
    assert found.relative == pytest.approx(0.05)


@pytest.mark.parametrize(
    "text",
    [
        *(
            "wall 10",
            "wall 10 degC",
            "walls 10 K",
            "sensor 8",
            "air much",
            "wall",
            "wall 1 K, wall 2 K",
        ),
        *("states 0", "states 0.5", "states -3", "states many", "states 4, states 9"),
        *("position 3", "position -1 mm", "position 1 K", "rotation 2", "rotation -1 mrad"),
        *("air -5 %", "sensor -8 um", "air 150 %", "wall K"),
    ],
)
def test_inputs_without_unit_or_sense_are_refused(text: str) -> None:
    with pytest.raises(InputError) as error:
        Inputs.of(text)
    assert error.value.code.startswith("uncertainty.")


@pytest.mark.parametrize(
    ("make", "code"),
    [
        (lambda: Inputs(sensor_mm=-0.1), "uncertainty.negative"),
        (lambda: Inputs(mesh=1.5), "uncertainty.no_fraction"),
        (lambda: Inputs(states=0.0), "uncertainty.few_states"),
        (lambda: Tolerance(20.0, 0.1, -0.1), "tolerance.no_width"),
        (lambda: Tolerance(math.nan, -0.1, 0.1), "tolerance.no_width"),
    ],
)
def test_wrong_statements_are_refused(make: object, code: str) -> None:
    assert callable(make)
    with pytest.raises(InputError) as error:
        make()
    assert error.value.code == code

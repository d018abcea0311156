"""Names of result columns taken apart into quantity, unit and state: names typed by hand."""

import pytest

from iriftrace.io.states import Column, column_of, states_of, time_in


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("T (K)", Column("T", "K", "")),
        ("T", Column("T", None, "")),
        ("x (mm)", Column("x", "mm", "")),
        ("T (K) @ t=0.5", Column("T", "K", "t=0.5")),
        ("T (degC) @ t=1, P=1E3", Column("T", "degC", "t=1, P=1E3")),
        ("ht.rho (kg/m^3) @ 2: P=5", Column("ht.rho", "kg/m^3", "2: P=5")),
        ("T-273.15[K] (K)", Column("T-273.15[K]", "K", "")),
        ("sqrt(T*T0) (K)", Column("sqrt(T*T0)", "K", "")),
        ("f(x) (W/(m^2*K)) @ t=3", Column("f(x)", "W/(m^2*K)", "t=3")),
        ("Temperature_@_t=0.25", Column("Temperature", None, "t=0.25")),
        ("Temperature_(K)_@_t=1,_P_in=2", Column("Temperature", "K", "t=1, P_in=2")),
        ("T/K", Column("T/K", None, "")),
        ("aveop1(T)", Column("aveop1(T)", None, "")),
        ("rho/T", Column("rho/T", None, "")),
        ("T (mean)", Column("T", "mean", "")),
    ],
)
def test_columns_are_taken_apart(text: str, column: Column) -> None:
    assert column_of(text) == column


def test_states_come_in_the_order_of_the_file() -> None:
    names = ["x", "T (K) @ t=2", "p (Pa) @ t=2", "T (K) @ t=10", "p (Pa) @ t=10"]
    assert states_of(column_of(name) for name in names) == [("t=2", 2.0), ("t=10", 10.0)]
    assert states_of(column_of(name) for name in ("T (K)", "p (Pa)")) == [("", None)]


@pytest.mark.parametrize(
    ("state", "time"),
    [("t=0.5", 0.5), ("P=3, t=1E-3", 1e-3), ("2: t=4", 4.0), ("Pt=3", None), ("", None)],
)
def test_the_time_of_a_state(state: str, time: float | None) -> None:
    assert time_in(state) == time

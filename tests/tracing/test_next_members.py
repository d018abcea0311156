"""Members to solve next, by the names and origins that the program writes."""

import pytest

from iriftrace.measuring.fit.next_members import Blown, draught_of, members_to_solve
from iriftrace.medium.source import FieldSource
from iriftrace.tracing.hot_air import FieldMember


def source(path: str, origin: str = "OpenFOAM buoyantPimpleFoam, coarse") -> FieldSource:
    return FieldSource(path, "", "T", "temperature", "mm", origin)


def advice(weights: dict[str, float], origin: str = "OpenFOAM", **options: object) -> str:
    members = [
        FieldMember(number, path, None, source(path, origin), weight)
        for number, (path, weight) in enumerate(weights.items(), start=1)
    ]
    return members_to_solve(members, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("path", "origin", "air"),
    [
        ("family/at_0.00.vtu", "", Blown(0.0, None)),
        ("family/at_0.125_from_022.5.vtu", "", Blown(0.125, 22.5)),
        ("family/at_0.13_from_090.vtu", "between 50% a.vtu, 50% b.vtu", Blown(0.13, 90.0)),
        ("a.vtu", "OpenFOAM x, mean, draught of 0.3 m/s from 90 deg", Blown(0.3, 90.0)),
        ("a.vtu", "OpenFOAM x, mean", Blown(0.0, None)),
        ("a.vtu", "OpenFOAM x, draught of 0.3 m/s from (0, 0.8, 0.6)", None),
        ("between a, b", "between a, b; the first: OpenFOAM, draught of 1 m/s from 9 deg", None),
        ("a.vtu", "COMSOL", None),
    ],
)  # fmt: skip
def test_draughts(path: str, origin: str, air: Blown | None) -> None:
    assert draught_of(source(path, origin)) == air


def test_beyond_the_fastest_with_all_the_weight() -> None:
    """As with members of 0, 0.1 and 0.2 m/s in a draught of 0.3 m/s, all from one direction."""
    said = advice({"at_0.00.vtu": 0.0, "at_0.10_from_090.vtu": 0.02, "at_0.20_from_090.vtu": 0.98})
    assert said == (
        "Solve next: draughts of 0.15 and 0.3 m/s and from 80 and 100 deg, and other temperatures "
        "of the wall."
    )


def test_between_two_that_share_the_weight() -> None:
    """Directions on both sides of 0 degrees are neighbours."""
    said = advice({"at_0.10_from_350.vtu": 0.6, "at_0.20_from_010.vtu": 0.4})
    assert "draughts of 0.15 m/s and from 0 deg" in said


def test_still_air_is_nearest_to_a_draught_from_elsewhere() -> None:
    said = advice({"at_0.00.vtu": 1.0, "at_0.10_from_090.vtu": 0.0}, other_body=True)
    assert "draughts of 0.05 m/s from other directions than 90 deg" in said
    assert said.endswith("and other bodies that stand in the hall.")


def test_walls_where_the_contrast_explains_it() -> None:
    origin = "synthetic: boundary layer (wall 1373.15 K, ambient 293.15 K)"
    assert "hotter walls than 1373.15 K, " in advice({"a.vtu": 1.0}, origin, scale=1.3)
    assert "cooler walls, as the contrast of the air is about 0.5 times" in advice(
        {"a.vtu": 1.0}, scale=0.5
    )


def test_fields_of_others_have_no_draught() -> None:
    assert "states around b.vtu, which has" in advice({"a.vtu": 0.1, "b.vtu": 0.9}, "COMSOL")

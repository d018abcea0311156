"""The facts of a measurement or correction in words, from values written by hand."""

from typing import Any

from attrs import evolve

from iriftrace.core.plain import plain
from iriftrace.figures.answer import groups
from iriftrace.figures.describe import provenance_rows
from iriftrace.figures.describe_scan import by_thing, describe, sentences, table
from iriftrace.measuring.two_devices.correction import SCHEMA
from iriftrace.measuring.uncertainty.budget import Contribution, Uncertainty
from iriftrace.medium.source import FieldFacts, FieldKind, FieldSource

FACTS = FieldFacts(FieldKind.SYNTHETIC)
FIELD = FieldSource("air.vtu", "12", "T", "temperature", "mm", "synthetic: formulas", facts=FACTS)


def test_a_result_names_the_files_of_all_fields() -> None:
    """Of an ensemble those of its members, else the only one."""
    stated = {"scene": {"path": "a/scene.xml", "sha256": "1"}, "part": {"path": None}}
    rows = provenance_rows(stated, FIELD)
    assert rows[:2] == (("scene", "scene.xml, SHA-256 1"), ("field", "air.vtu, SHA-256 12"))
    members = [
        {"number": number, "source": plain(evolve(FIELD, path=f"{number}.vtu"))}
        for number in (1, 2)
    ]
    rows = provenance_rows({**stated, "ensemble": {"members": members}}, FIELD)
    assert [text for name, text in rows if name.startswith("field")] == [
        f"{number}.vtu, SHA-256 12" for number in (1, 2)
    ]


def clouds(measured: Any, corrected: Any, drawing: Any) -> dict[str, Any]:
    return {"measured": measured, "corrected": corrected, "drawing": drawing}


def cone() -> dict[str, Any]:
    """12.3 mm, 4 um smaller by the air, with u of 3 and 4 um: U = 2 x 5 um."""
    return {
        "kind": "cone",
        "region": "cone 1",
        "points": 990,
        "left_out": 10,
        "not_corrected": 7,
        "size_mm": clouds(12.296, 12.3, 12.2),
        "u_size_mm": clouds(0.0, 0.0, 0.0),
        "form_mm": clouds(0.02, 0.01, 0.01),
        "position_mm": clouds([0, 0, 1], [0, 0, 1], [0, 0, 0.99]),
        "value_mm": 12.2,
        "U_mm": 0.01,
        "k": 2.0,
        "interval_mm": [12.19, 12.21],
        "contributions": [
            {"group": "sensor", "u_mm": 0.004, "share": 0.64, "type": "A", "source": "scatter"},
            {"group": "growth", "u_mm": 0.003, "share": 0.36, "type": "B", "source": "stated"},
        ],
        "not_covered": ["air"],
        "decision": {
            "nominal": 12.2,
            "deviations": [-0.05, 0.05],
            "verdict": "not decided",
            "probability_outside": 1e-9,
            "risk": None,
            "reason": "not known: air",
            "as_measured_within": True,
        },
    }


def plane() -> dict[str, Any]:
    nothing = clouds(None, None, None)
    rest = {"size_mm": nothing, "u_size_mm": nothing, "left_out": 0, "not_corrected": 0}
    return {"kind": "plane", "region": None, "points": 1000} | {
        **rest,
        "form_mm": clouds(0.005, 0.002, 0.002),
        "position_mm": clouds([0, 0, 0], [0, 0, 0], [0, 0, 0]),
    }


def values(**more: Any) -> dict[str, Any]:
    median = {"median": 1e-3, "rms": 2e-3, "p95": 3e-3}
    region = {"region": "cone 1", "points": 9, "measured": 0.5, "along_normal_mm": median}
    return {
        "schema": SCHEMA,
        "points": {"measured": 2007, "corrected": 2000, "hidden": 7},
        "error_mm": median,
        "growth": {"expansion_per_k": 1e-5, "reference_k": 293.15, "hot_k": 1293.15},
        "field": plain(FIELD),
        "assumptions": {"field_origin": FIELD.origin},
        "features": [cone(), plane()],
        "regions": [
            {**region, "size_p95_mm": 4e-3},
            {**region, "region": "rest", "points": 0, "along_normal_mm": None, "size_p95_mm": None},
        ],
        **more,
    }


def test_a_feature_has_its_sizes_with_units_and_the_parts_of_its_uncertainty() -> None:
    rows = describe(values(), {"cone 1": "cone 1 (top)"})
    features = by_thing(rows, "feature")
    assert features["Cone (cone 1 (top))"] == {
        "points": "990",
        "left out": "10 of 1,000",
        "not corrected": "7",
        "form measured": "20 um",
        "form corrected": "10 um",
        "at": "(0.00, 0.00, 1.00) mm",
        "measured": "12.2960 mm",
        "corrected": "12.3000 mm",
        "air makes it": "4 um smaller",
        "On the drawing at 20 degC": "12.2000 mm ((0.00, 0.00, 0.99) mm of its axis)",
        "U": "at least 10 um (k = 2; sensor 8 um, growth 6 um; not known: air), more than the "
        "air's effect",
    }
    assert features["Plane"] == {
        "points": "1,000",
        "form measured": "5 um",
        "form corrected": "2 um",
    }


def test_a_table_has_a_line_for_each_thing_and_gaps_where_it_has_no_value() -> None:
    headings, (first, second) = table(describe(values()), "feature")
    assert headings[:3] == ["feature", "points", "left out"]
    assert first[:3] == ["Cone (cone 1)", "990", "10 of 1,000"]
    assert second[:3] == ["Plane", "1,000", ""]
    assert len(first) == len(second) == len(headings)
    assert table(describe(values(features=[])), "feature") == ([], [])


def test_sentences_end_with_a_full_stop_and_regions_without_a_point_are_counted() -> None:
    rows = describe(values())
    assert sentences(rows, "answer") == [
        "2,000 of 2,007 points are corrected, by 1 um (median; 95th percentile 3 um)."
    ]
    assert sentences(rows, "note")[-1] == "Without a measured point: 1 region."
    assert by_thing(rows, "region") == {
        "cone 1": {
            "points": "9",
            "measured": "50%",
            "median": "1 um",
            "rms": "2 um",
            "95 % below": "4 um",
        }
    }


def test_the_answer_is_value_u_and_verdict() -> None:
    assert sentences(describe(values()), "verdict") == [
        "Diameter of cone 1 at (0.00, 0.00, 0.99) mm of its axis, on the drawing at 20 degC: "
        "12.200 mm, U = at least 0.010 mm (k = 2, 95 %: 12.190 .. 12.210; not covered: air); 990 "
        "points, 10 left out as outliers, 7 without correction.",
        "Tolerance 12.150 .. 12.250 mm: not decided (as measured, on the drawing: 12.196 mm, "
        "within).",
    ]
    moved = "2,000 of 2,007 points are corrected, by 1 um (median; 95th percentile 3 um); as "
    assert sentences(describe(values()), "points moved") == [
        f"{moved}measured stay 7 hidden from a device."
    ]


def test_shares_are_per_cent_without_powers_of_ten() -> None:
    stated = Uncertainty(5.0, tuple(Contribution(str(u), u) for u in (1.0, 0.1, 0.005)), (3.0, 7.0))
    assert [row[2] for row in groups(stated, "mm")] == ["99 %", "0.99 %", "below 0.01 %"]
    (alone,) = groups(evolve(stated, contributions=stated.contributions[:1]), "mm")
    assert alone[2] == "100 %"


def test_air_from_formulas_is_named() -> None:
    """Also where only a member of an ensemble is synthetic."""
    stated = {"u_normal_mm": {"median": 1e-3, "p95": 2e-3}}
    ensemble = {"field": None, "ensemble": {"members": [{"source": plain(FIELD)}]}}
    for more in (stated, ensemble):
        rows = describe(values(**more))
        assert sentences(rows, "field") == ["SYNTHETIC FIELD: formulas."]
    rows = describe(values(field=None, **stated))
    assert sentences(rows, "answer")[1:] == [
        "Standard uncertainty of a corrected point along the normal: 1 um (median; 95th percentile "
        "2 um).",
    ]

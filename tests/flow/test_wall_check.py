"""Temperatures that the wall of a checked field is expected to have, given or recorded."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista as pv

from iriftrace.cli import main
from iriftrace.io.part_files import read_part
from iriftrace.medium.origin import state_origin
from iriftrace.medium.source import FieldFacts, Variation
from validation.inputs import hot_block


def two_temperatures(folder: Path) -> tuple[Path, Path]:
    """The hot block whose upper side has 1000 K in place of `hot_block.WALL`; field and part."""
    field, part = hot_block.save(folder)
    grid = pv.read(field)
    points = np.asarray(grid.points)
    upper = (points[:, 2] > hot_block.HALF - 1e-6) & (np.abs(points) < hot_block.HALF + 1e-6).all(1)
    grid.point_data["T"][upper] = 1000.0
    grid.save(field)
    return field, part


REGIONS = ["--region-temperature", "plane +z=1000 K"]


def test_regions_have_temperatures_of_their_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    field, part = two_temperatures(tmp_path)
    wall = ["--wall-temperature", f"{hot_block.WALL} K"]
    words = ["field", "check", str(field), str(part), "-o", str(tmp_path / "check.json")]

    def verdict(*options: str) -> tuple[str, float]:
        assert main([*words, *options]) == 0
        findings = json.loads((tmp_path / "check.json").read_text())["findings"]
        found = next(f for f in findings if f["name"] == "wall temperature")
        return found["verdict"], found["numbers"]["worst_k"]

    assert verdict(*wall) == ("bad", pytest.approx(hot_block.WALL - 1000.0))
    # Points on the upper edges are as near to one region as to another.
    assert verdict(*wall, *REGIONS, "--transition", "0 mm")[1] < 294.0
    capsys.readouterr()
    assert main([*words, *wall, "--region-temperature", "lid=1000 K"]) == 2
    assert 'no region "lid"; its regions are' in capsys.readouterr().err
    assert main([*words, *REGIONS]) == 2
    assert (
        "the rest of the wall has none; give it one too (--wall-temperature)."
        in capsys.readouterr().err
    )


def record_of(part: Path, wall_k: float) -> dict[str, object]:
    """Record of a case whose lid has 1000 K."""
    return {
        "part_bounds_mm": read_part(part).bounds.tolist(),
        "wall_k": wall_k,
        "regions_k": {"plane +z": 1000.0},
        "transition_mm": 0.0,
    }


def test_temperatures_of_the_case_beside_the_field_are_the_default(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    field, part = two_temperatures(tmp_path)
    record = record_of(part, hot_block.WALL)
    file = tmp_path / "case.json"
    words = ["field", "check", str(field), str(part), "-o", str(tmp_path / "check.json")]

    def found() -> float:
        assert main(words) == 0
        findings = json.loads((tmp_path / "check.json").read_text())["findings"]
        numbers = next(f["numbers"] for f in findings if f["name"] == "wall temperature")
        return float(numbers["share_within"])

    alone = found()
    file.write_text(json.dumps(record))
    capsys.readouterr()
    with_case = found()
    assert with_case > alone
    assert "are those of" in " ".join(capsys.readouterr().out.split())
    for other in (record | {"part_bounds_mm": [[0, 0, 0], [1, 1, 1]]}, {"some": "file"}, [1]):
        file.write_text(json.dumps(other))
        assert found() == alone


def wall_finding(field: Path, part: Path, *words: str) -> dict[str, Any]:
    file = field.with_name("check.json")
    assert main(["field", "check", str(field), str(part), "-o", str(file), *words]) == 0
    findings = json.loads(file.read_text())["findings"]
    return next(one for one in findings if one["name"] == "wall temperature")


def test_a_field_that_varies_the_wall_is_expected_to_be_hotter(tmp_path: Path) -> None:
    """By 20 K than the record of the first case next to it; one that varies the room is not."""
    _, part = hot_block.save(tmp_path)
    record = record_of(part, hot_block.WALL - 20.0) | {"regions_k": {}}
    (tmp_path / "case.json").write_text(json.dumps(record))
    for quantity, verdict in (("wall", "good"), ("ambient", "bad")):
        air = hot_block.air()
        state_origin(air, "OpenFOAM", FieldFacts(variation=Variation(quantity, 20.0, "0" * 64)))
        air.save(tmp_path / "varied.vtu")
        assert wall_finding(tmp_path / "varied.vtu", part)["verdict"] == verdict


def test_a_measured_wall_is_not_compared_with_its_median(tmp_path: Path) -> None:
    field, part = two_temperatures(tmp_path)
    assert wall_finding(field, part)["verdict"] == "bad"
    record = record_of(part, hot_block.WALL) | {"wall_from": {"file": "scan.csv", "sha256": "0"}}
    (tmp_path / "case.json").write_text(json.dumps(record))
    found = wall_finding(field, part)
    assert found["verdict"] == "-"
    assert (
        found["remark"] == f"1000.00 to {hot_block.WALL:.2f} K; set to the temperatures in scan.csv"
    )
    assert wall_finding(field, part, "--wall-temperature=900 K")["verdict"] == "bad"

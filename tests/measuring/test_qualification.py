"""The qualification: both engines pass, shells of the outer rule do not, and other answers."""

import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from attrs import evolve

from iriftrace.cli import main
from iriftrace.core.engines import Engine
from iriftrace.core.errors import InputError
from iriftrace.core.files import write_json
from iriftrace.core.plain import plain
from iriftrace.measuring import qualification
from iriftrace.measuring.qualification import judge, read_kit, read_results, traced_kit
from iriftrace.tracing.hot_air import HotAir

NAMES = [
    "01_slab",
    "02_cylinder",
    "03_sphere",
    "04_plate",
    "05_slab_devices",
    "06_cylinder_devices",
]


pytestmark = pytest.mark.slow  # the kit takes long to compute


@pytest.fixture(scope="module")
def kit(variant: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A kit that the command wrote, with the verdicts on both engines next to it."""
    folder = tmp_path_factory.mktemp("qualify") / "kit"
    assert main(["qualify", str(folder), "-o", str(folder.with_name("verdicts.json"))]) == 0
    return folder


def verdicts(path: Path) -> dict[str, list[dict[str, Any]]]:
    """Verdicts in a report, by tracer."""
    return dict(json.loads(path.read_text(encoding="utf-8"))["verdicts"])


def test_both_engines_pass_every_scenario(kit: Path) -> None:
    found = verdicts(kit.with_name("verdicts.json"))
    assert set(found) == {"iriftrace, shells", "iriftrace, cells"}
    for rows in found.values():
        assert [row["scenario"] for row in rows] == NAMES
        assert all(row["passes"] and 0.0 < row["error"] <= row["bound"] <= 0.03 for row in rows)


def test_shells_at_the_layers_outer_index_fail_every_scenario(
    kit: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They miss a part of the bending that goes with one over the number of shells: 5 %."""
    theirs, report = tmp_path / "theirs.json", tmp_path / "verdicts.json"
    monkeypatch.setattr(qualification, "HotAir", partial(HotAir, rule="outer"))
    write_json(theirs, plain(traced_kit(read_kit(kit), Engine.SHELLS)))
    assert main(["qualify", str(kit), "--results", str(theirs), "-o", str(report)]) == 1
    ((_, rows),) = verdicts(report).items()
    assert [row["scenario"] for row in rows] == NAMES
    assert not any(row["passes"] for row in rows)
    assert all(0.05 < row["error"] < 0.08 for row in rows)


def test_a_point_that_the_second_device_does_not_see_has_no_answer(kit: Path) -> None:
    """It looks at the plate from below; the other rays keep their answers."""
    (plate,) = (one for one in read_kit(kit) if one.name == "05_slab_devices")
    assert plate.stated.second_mm is not None
    first, *others = plate.stated.second_mm
    below = (first[0], first[1], -first[2])
    hidden = evolve(plate, stated=evolve(plate.stated, second_mm=(below, *others)))
    ((answer, *rest),) = traced_kit([hidden], Engine.SHELLS).vectors_mm.values()
    ((_, *known),) = traced_kit([plate], Engine.SHELLS).vectors_mm.values()
    assert answer is None
    assert rest == known
    assert None not in rest


def test_an_error_is_the_distance_over_the_truth(kit: Path) -> None:
    """Of the worst ray, or of the median; no answer is none."""
    scenarios = read_kit(kit)
    exact = {one.name: list(one.stated.truth_mm) for one in scenarios}
    off: dict[str, Any] = {name: list(rows) for name, rows in exact.items()}
    off["01_slab"][1] = tuple(1.02 * x for x in exact["01_slab"][1])  # one ray beyond 1 %
    off["04_plate"][0] = (1.0, 0.0, 0.0)  # one ray of nine, of which the median counts
    off["02_cylinder"][3] = None
    del off["03_sphere"]
    found = {one.scenario: one for one in judge(scenarios, off)}
    assert found["01_slab"].error == pytest.approx(0.02)
    assert found["04_plate"].error == 0.0
    assert (found["02_cylinder"].error, found["03_sphere"].error) == (None, None)
    passed = [name for name, one in found.items() if one.passes]
    assert passed == ["04_plate", "05_slab_devices", "06_cylinder_devices"]
    with pytest.raises(InputError) as error:
        judge(scenarios, {"01_slab": exact["01_slab"][:2]})
    assert error.value.code == "scenario.ray_count"


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"schema": "other/1"}, "file.schema"),
        ({"vectors_mm": {"01_slab": [[0.0, 0.0]]}}, "file.damaged"),
        ({"vectors_mm": {"01_slab": [[0.0, 0.0, "x"]]}}, "file.damaged"),
    ],
)
def test_files_that_are_no_answers_are_refused(
    kit: Path, tmp_path: Path, change: dict[str, Any], code: str
) -> None:
    stated = json.loads((kit / "results_cells.json").read_text(encoding="utf-8"))
    path = tmp_path / "theirs.json"
    path.write_text(json.dumps({**stated, **change}), encoding="utf-8")
    with pytest.raises(InputError) as error:
        read_results(path)
    assert error.value.code == code
    report = tmp_path / "verdicts.json"
    assert main(["qualify", str(kit), "--results", str(path), "-o", str(report)]) == 2
    assert not report.exists()


def test_answers_to_no_scenario_and_kits_without_one_are_refused(kit: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        judge(read_kit(kit), {"07_other": []})
    assert error.value.code == "scenario.unknown_name"
    with pytest.raises(InputError) as error:
        read_kit(tmp_path)
    assert error.value.code == "scenario.none"
    other, theirs = tmp_path / "other", kit / "results_cells.json"
    assert main(["qualify", str(other), "--results", str(theirs)]) == 2
    assert not other.exists()


@pytest.mark.parametrize(
    ("change", "code"),
    [
        ({"direction": [[0.0, 0.0, -1.0]]}, "scenario.ray_count"),
        ({"judged": "mean"}, "scenario.unknown_name"),
        ({"bound": None}, "file.damaged"),
    ],
)
def test_changed_scenarios_are_refused(
    kit: Path, tmp_path: Path, change: dict[str, Any], code: str
) -> None:
    stated = json.loads((kit / NAMES[0] / "scenario.json").read_text(encoding="utf-8"))
    (tmp_path / "01").mkdir()
    text = json.dumps({**stated, **change})
    (tmp_path / "01" / "scenario.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as error:
        read_kit(tmp_path)
    assert error.value.code == code


def test_an_engine_does_not_judge_results_of_another_program(
    kit: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    results = str(kit / "results_shells.json")
    assert main(["qualify", str(kit), "--results", results, "--engine=cells"]) == 2
    assert "--engine is of this program" in " ".join(capsys.readouterr().err.split())

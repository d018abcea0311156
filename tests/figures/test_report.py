"""The report: complete, embedded, escaped, and with the numbers of the plan."""

import json
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from iriftrace.camera.orbit import Orbit, orbit_poses
from iriftrace.camera.pose import pose_text
from iriftrace.core.errors import InputError
from iriftrace.core.plain import plain
from iriftrace.figures import report as report_module
from iriftrace.figures.describe import fields_of
from iriftrace.figures.report import sweep_page, write_report
from iriftrace.figures.report_page import BlockKind
from iriftrace.image.aov_image import Status
from iriftrace.medium.source import FieldFacts, FieldKind, FieldSource
from iriftrace.planning.cover import plan_views
from iriftrace.planning.criteria import Criteria, Views
from iriftrace.planning.summary import SweepSummary, summarise
from iriftrace.planning.texts import front_text, ranking_table, stability_text, views_text
from validation.inputs.sweep_tables import sweep_table, with_faces
from validation.oracles.html_page import Page, read_page

HOSTILE = "<img src=x onerror='go()'>&amp;<script>go().ply"
DOT = (
    b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x00\x01\x00\x00\x00\x01\x08\x00\x00\x00\x00:~\x9bU"
    b"\x00\x00\x00\nIDATx\x9cc`\x00\x00\x00\x02\x00\x01H\xaf\xa4q\x00\x00\x00\x00IEND\xaeB`\x82"
)
FILE = b"the poses of a sweep"
POSES = orbit_poses(Orbit((0.0, 0.0, 0.0), (300.0, 200.0, 200.0)), [0.0, 45.0], [0.0, 30.0])


def sweep() -> xr.Dataset:
    table = sweep_table(
        [1e-3, 2e-3, 3e-3, 4e-3],
        [0.04, 0.4, 0.3, 0.2],
        [0.1, 0.2, 0.1, 0.3],
        [0.3, 0.2, 0.1, 0.3],
        poses=POSES,
    )
    counts = {Status.GOOD: 1000, Status.MISSED: 3000, Status.OUT_OF_FOCUS: 500}
    for status in Status:
        rays = np.full((4, 1), counts.get(status, 0))
        rays[3] = 50 if status is Status.GOOD else 0
        table[f"rays_{status.key}"] = (("pose", "region"), rays)
    table["rays_hit"] = (("pose", "region"), np.array([[1500], [1500], [1500], [50]]))
    table["rays_open_boundary"] = ("pose", np.array([61, 0, 0, 0]))
    table["triangles_in_view"] = ("pose", np.full(4, 77))
    table.attrs.update(
        version="9.8.7",
        variant="llvm_ad_mono",
        wavelength_nm=633.0,
        part=json.dumps({"path": f"/a/{HOSTILE}", "sha256": "abcdef" * 10}),
        field=json.dumps({"path": "air.vtu", "sha256": "12", "quantity": "temperature"}),
        scene=json.dumps({"path": "/a/scene.xml", "sha256": "34", "variables": {"scale": "0.1"}}),
        camera=json.dumps(
            {
                "projection": "pinhole",
                "focal_length_mm": 10.0,
                "sensor_mm": [6.7, 5.6],
                "resolution": [240, 200],
                "distortion": None,
                "focus_mm": [50.0, None],
            }
        ),
        assumptions=json.dumps({"optics": "geometric optics", "index_rule": "midpoint"}),
    )
    seen = [[(0, 10, 1e-3, 20.0)], [(0, 10, 1e-3, 20.0), (1, 5, 2e-3, 40.0)], [], []]
    return with_faces(table, seen, [1.0, 2.0, 1.0])


def with_rig(table: xr.Dataset) -> xr.Dataset:
    """The same sweep of two devices."""
    for statistic in ("mean", "median", "p95"):
        table[f"error_normal_{statistic}"] = table[f"displacement_{statistic}"]
    table["coverage_measured"] = table["coverage"]
    table["points_measured"] = table["rays_good"]
    table.attrs["rig"] = json.dumps({"device": "camera_2", "to_first": np.eye(4).tolist()})
    return table


def content(table: xr.Dataset, summary: SweepSummary, section: str, kind: BlockKind) -> list[Any]:
    """Contents of the blocks of a kind in a section of the page without figures."""
    page = sweep_page(table, summary, {})
    (found,) = (each["blocks"] for each in page.sections if each["name"] == section)
    return [block["content"] for block in found if block["kind"] == kind]


@pytest.fixture
def page(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> Page:
    """The report with one dot in place of the figures, which are tested elsewhere."""

    missing = ("The rest is left out & <b>missing</b>.",)
    monkeypatch.setattr(report_module, "sweep_charts", lambda _: {"pareto": Figure()})
    monkeypatch.setattr(report_module, "sweep_pictures", lambda *_: ({}, missing))
    monkeypatch.setattr(report_module, "figure_bytes", lambda _: DOT)
    table = sweep()
    swept = tmp_path_factory.mktemp("sweeps") / "sweep.nc"
    swept.write_bytes(FILE)
    table.encoding["source"] = str(swept)
    assert missing == write_report(tmp_path / "report.html", table, summarise(table), top=2)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["report.html"]
    return read_page(tmp_path / "report.html")


def test_the_page_needs_nothing_else(page: Page) -> None:
    page.assert_needs_nothing()
    assert page.pictures == [DOT]


def test_text_from_files_is_text(page: Page) -> None:
    """Names are data: neither tags nor entities of theirs come into effect."""
    assert f"Where to put the camera: {HOSTILE}" in page.text
    assert "left out & <b>missing</b>." in page.text


def test_the_numbers_are_those_of_the_plan(page: Page) -> None:
    summary = summarise(sweep())
    ranking = ranking_table(summary, 2)
    tables = {tuple(table[0]): table[1:] for table in page.tables}
    # On the first page, in full, and those of the front, which has the same columns.
    first, whole, front = (
        [tuple(row) for row in table[1:]]
        for table in page.tables
        if tuple(table[0]) == ranking.headings
    )
    assert first == whole == list(ranking.rows)
    poses = [int(row[1]) for row in front]
    assert sorted(poses) == summary.front.tolist()
    assert f"poses {', '.join(map(str, summary.front.tolist()))}." in front_text(summary)
    assert stability_text(summary) in page.text
    best = summary.plan.best
    text = pose_text(summary.matrices[best], summary.distance[best])
    assert [lines.splitlines() for lines in page.listings] == [list(text.matrix), list(text.xml)]
    assert text.look_at in page.by_id["summary"]
    assert (
        "weight of",
        "rank at \N{MINUS SIGN}50 %",
        "best pose",
        "rank at +50 %",
        "best pose",
    ) in tables


def test_setting_and_limits_are_complete(page: Page) -> None:
    setting = dict(next(table for table in page.tables if table[0][0] == "Part"))
    assert setting["Field"] == "air.vtu (SHA-256 12…), temperature; light of 633 nm"
    assert setting["Camera"].endswith(
        "240 \N{MULTIPLICATION SIGN} 200 pixels, in focus from 50 mm to infinity"
    )
    assert setting["Poses"].startswith("4, azimuth 0 to 45°, elevation 0 to 30°, distance")
    assert setting["Scene parameters"] == "scale = 0.1"
    limits = page.by_id["limits"]
    assert "1 of 4 poses are not ranked; 0 failed and 1 see fewer than 100 good rays" in limits
    assert "61 good rays (2 %) pass an open end of the data" in limits
    assert "25.0 % of the part's area is seen by no pose." in limits
    assert "geometric optics" in limits
    rays = next(table for table in page.tables if table[0][0] == "outcome")
    # 3050 good, 9000 missed, 1500 out of focus.
    assert rays[1:] == [
        ["Good", "3,050", "67.0 %"],
        ["Missed the part", "9,000", ""],
        ["Out of focus", "1,500", "33.0 %"],
    ]
    assert ["3", "50 good rays, fewer than 100"] in page.tables[-1]
    assert f"iriftrace 9.8.7 from sweep.nc (SHA-256 {sha256(FILE).hexdigest()})" in page.text


def test_every_field_of_an_ensemble_is_named() -> None:
    """The sweep's own attribute names the first one only."""
    table = sweep()
    sources = [{"path": f"air_{k}.vtu", "sha256": f"{k}", "quantity": "density"} for k in (1, 2)]
    members = [{"number": k, "source": source} for k, source in enumerate(sources, start=1)]
    table.attrs["scenes"] = json.dumps([{"field": sources[0], "members": members}])
    (setting,) = content(table, summarise(table), "setting", "names")
    named = dict(setting)["Field"]
    assert "air_1.vtu" in named
    assert "air_2.vtu" in named


def test_a_field_that_varies_another_one_is_not_among_those_of_the_means() -> None:
    table = sweep()
    sources = [{"path": f"air_{k}.vtu", "sha256": f"{k}"} for k in (1, 2, 3)]
    members = [
        {"source": source, "weight": weight}
        for source, weight in zip(sources, (1.0, 0.0, 1.0), strict=True)
    ]
    table.attrs["scenes"] = json.dumps([{"field": sources[0], "members": members}])
    assert fields_of(table) == [sources[0], sources[2]]


@pytest.mark.parametrize("rig", [False, True])
def test_texts_name_the_ranked_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rig: bool
) -> None:
    """A rig is ranked by the error of its points, and displacement is of one camera."""
    names = ("pareto", "map_displacement", "map_scatter", "scene_scatter")
    drawn = dict.fromkeys((*names, "view_smallest_displacement"), Figure())
    monkeypatch.setattr(report_module, "sweep_charts", lambda _: drawn)
    monkeypatch.setattr(report_module, "sweep_pictures", lambda *_: ({}, ()))
    monkeypatch.setattr(report_module, "figure_bytes", lambda _: DOT)
    table = with_rig(sweep()) if rig else sweep()
    write_report(tmp_path / "report.html", table, summarise(table))
    page = read_page(tmp_path / "report.html")
    error = "error along the normal" if rig else "displacement"
    for said in (
        f"Coverage against 95th-percentile {error}, coloured",
        f"95th-percentile {error} over the direction",
        f"the pose with the smallest 95th-percentile {error} sees",
        f"as one of these in 95th-percentile {error}, coverage",
        "Scatter over the fields, over the direction",
        "coloured by scatter over the fields",
    ):
        assert said in page.text, said
    (weights,) = (table for table in page.tables if table[0][0] == "weight of")
    assert weights[1][0] == error
    assert ('inside the second sensor (id="camera_2")' in page.text) is rig


def test_a_winner_that_is_not_clear_is_said() -> None:
    """Pose 0 sees a tenth of pose 1; with these weights both score the same."""
    table = sweep()
    summary = summarise(table, Criteria(1, 0.5, 0, 0, percentile=100))
    ((unclear,),) = content(table, summary, "summary", "doubt")
    assert "pose 0 scores" in unclear or "pose 1 scores" in unclear
    ((little,),) = content(table, summarise(table, Criteria(1, 0, 0, 0)), "summary", "doubt")
    assert little.startswith("The best pose sees")
    assert content(table, summarise(table, Criteria(0, 1, 0, 0)), "summary", "doubt") == []
    with pytest.raises(InputError, match="0 rows"):
        sweep_page(table, summary, {}, top=0)


def test_rounding_of_a_plane_seen_frontally_is_0() -> None:
    """Its steps have no depth."""
    table = sweep()
    table["axial_resolution"][:, 0] = [3e-6, 2e-2, 1e-2, 3e-2]
    table["lateral_resolution"][:, 0] = [3e-2, 2e-2, 1e-2, 3e-2]
    summary = summarise(table)
    assert summary.plan.best == 0
    ((answer, *_),) = content(table, summary, "summary", "answer")
    assert "axial resolution 0 (plane seen frontally)" in answer
    notes = [sentence for text in content(table, summary, "ranking", "text") for sentence in text]
    assert "Axial resolution 0: plane seen frontally." in notes
    (rows, _) = content(table, summary, "ranking", "numbers")
    column = ranking_table(summary, 2).headings.index(summary.axial.label)
    assert rows[0][column] == "0"
    assert rows[1][column] in ("20.00", "10.00")


def test_what_decides_stands_in_the_first_box() -> None:
    """The field is made up, and the sweep warned of the best pose."""
    table = sweep()
    origin = "synthetic: formulas, no simulation; synthetic: others"
    facts = FieldFacts(FieldKind.SYNTHETIC)
    field = FieldSource("air.vtu", "12", "T", "temperature", "mm", origin, facts=facts)
    table.attrs["field"] = json.dumps(plain(field))
    table.attrs["part"] = json.dumps({"path": "/a/part.ply", "source": "flange.stl"})
    best = summarise(table).plan.best
    table["warned"] = ("pose", np.where(np.arange(4) == best, 1 + 8, 0).astype("i1"))
    table["through_cells"] = ("pose", np.array([0.0, 1.0, 0.0, np.nan]))
    summary = summarise(table)
    assert sweep_page(table, summary, {}).title == "Where to put the camera: flange.stl"
    ((_, field_text, engines, warned),) = content(table, summary, "summary", "answer")
    assert engines.startswith("1 of 4 poses were traced through the field data")
    (assumptions, _) = content(table, summary, "limits", "names")
    assert dict(assumptions)["engine"].endswith(engines)
    assert field_text.startswith("SYNTHETIC FIELD: formulas, no simulation; others.")
    assert "shells too few" in warned
    assert "part reaches beyond the picture" in warned
    (rows, _) = content(table, summary, "ranking", "numbers")
    ((note, _),) = content(table, summary, "ranking", "text")
    column = ranking_table(summary, 4).headings.index("warned")
    letters = {row[1]: row[column] for row in rows}
    assert letters.pop(str(best)) == "sb"
    assert set(letters.values()) == {""}
    assert "s shells too few" in note


def test_several_views_and_the_best_pose_are_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures = {"view_best": Figure(), "scene_score": Figure()}
    monkeypatch.setattr(report_module, "sweep_charts", lambda _: {})
    monkeypatch.setattr(report_module, "sweep_pictures", lambda *_: (pictures, ()))
    monkeypatch.setattr(report_module, "figure_bytes", lambda _: DOT)
    table = sweep()
    write_report(tmp_path / "report.html", table, summarise(table), views=Views(2))
    page = read_page(tmp_path / "report.html")
    assert "What the best pose sees." in page.by_id["summary"]
    assert "figures" not in page.by_id, "no empty section"
    # Pose 1 sees both faces that any pose sees, 3 of 4 mm^2; another one would add nothing.
    assert "Together they see 75.00 % of the area of the part" in page.by_id["views"]
    chosen = next(rows for rows in page.tables if rows[0][0] == "view")
    assert [row[1] for row in chosen[1:]] == ["1"]


def test_views_of_two_devices_are_said_to_be_the_cameras() -> None:
    table = with_rig(sweep())
    found = summarise(table)
    text = views_text(found, plan_views(table, Views(1), found.plan.criteria))
    assert "their cameras (not both devices) see 75.00 % of" in text

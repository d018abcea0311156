"""Metrics against numbers computed by hand from an image whose every pixel is known."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from attrs import evolve
from rich.console import Console

from iriftrace.camera.camera import Camera
from iriftrace.cli.output import print_summary
from iriftrace.core.errors import InputError, IriftraceWarning
from iriftrace.image.aov_image import Status
from iriftrace.image.metrics import TIMES, pose_metrics, write_metrics
from iriftrace.image.ray_statistics import RayCounts, percent
from iriftrace.part.regions import Regions
from validation.oracles.aov_by_hand import make_image, make_part, plate

WIDTH, HEIGHT = 20, 10
CAMERA = Camera(sensor_mm=(20, 10), resolution=(WIDTH, HEIGHT), projection="orthographic")
# Two plates at 50 mm side by side fill the picture's columns 1 to 18: left 9 columns, right 9.
LEFT, RIGHT = (plate((4.5, 0, 0), (0, 5, 0), (x, 0, 50)) for x in (-4.5, 4.5))
PART = make_part(
    np.concatenate((LEFT.vertices, RIGHT.vertices)),
    np.concatenate((LEFT.faces, RIGHT.faces + 4)),
    regions=Regions(np.array([0, 0, 1, 1]), ("left", "right")),
)
HEADER = {
    "pose": {"origin_mm": [0, 0, 0], "matrix": np.eye(4).tolist()},
    "part": {"path": "by hand", "sha256": PART.sha256},
    "time_s": {"load": 1.0, "straight": 0.25},
    "counts": {"open_boundary": 3, "triangles_in_view": 77},
    "assumptions": {"engine": "by hand"},
}
COLUMN, ROW = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
# 1 um to 200 um, one value for each pixel.
AMOUNT = 1e-3 * (1 + ROW * WIDTH + COLUMN)
SEEN = (COLUMN >= 1) & (COLUMN <= 18)


def metrics_of(status: Any = None, **options: Any) -> dict[str, Any]:
    vector = AMOUNT[..., None] * np.array([0.6, 0.0, -0.8])
    shift = AMOUNT[..., None] * np.array([3.0, 4.0])
    image = make_image(CAMERA, PART, displacement=vector, shift=shift, status=status, header=HEADER)
    return pose_metrics(image, PART, **options).as_dict()


def test_statistics_of_displacement_and_shift() -> None:
    """The displacement is (0.6, 0, -0.8) times the amount, so 0.6 across and 0.8 along."""
    metrics = metrics_of()
    values = np.sort(AMOUNT[SEEN])
    # 180 values: the median lies between the 90th and 91st, the 95th percentile at rank 170.05,
    # the quartiles at 44.75 and 134.25.
    p95 = values[170] + 0.05 * (values[171] - values[170])
    expected = {
        "mean": values.sum() / 180,
        "median": (values[89] + values[90]) / 2,
        "p95": p95,
        "p25": values[44] + 0.75 * (values[45] - values[44]),
        "p75": values[134] + 0.25 * (values[135] - values[134]),
        "max": values[-1],
        "rms": np.sqrt((values**2).sum() / 180),
    }
    assert metrics["displacement_mm"] == pytest.approx(expected, rel=1e-6)
    assert metrics["displacement_lateral_mm"] == pytest.approx(0.6 * expected["mean"], rel=1e-6)
    assert metrics["displacement_axial_mm"] == pytest.approx(0.8 * expected["mean"], rel=1e-6)
    del expected["rms"]
    assert metrics["shift_px"] == pytest.approx(
        {key: 5 * value for key, value in expected.items()}, rel=1e-6
    )
    assert metrics["incidence_angle_deg"] == pytest.approx(0, abs=1e-3)
    assert metrics["coverage"] == 1.0
    assert metrics["coverage_area"] == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize(("tilt", "text"), [(0.0, "0 (plane seen frontally)"), (0.01, "9.548 um")])
def test_summary_says_why_an_axial_resolution_is_0(
    tilt: float, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A plate that falls back from one pixel of 1 mm to the next one on the right.

    199 of the 200 pixels have a neighbour on the right or below, 190 of them one on the right:
    10 um * 190 / 199.
    """
    part = plate((10, 0, 10 * tilt), (0, 5, 0), (0, 0, 50))
    header = {**HEADER, "part": {"path": "by hand", "sha256": part.sha256}}
    moved = (3e-6, 0, 0)
    metrics = pose_metrics(make_image(CAMERA, part, displacement=moved, header=header), part)
    metrics = evolve(metrics, time_s=dict.fromkeys(TIMES, 1.0))
    console = Console(width=200, file=io.StringIO())
    monkeypatch.setattr("iriftrace.cli.output.out", console)
    print_summary(metrics)
    assert f"lateral 1000 um, axial {text} (step to the next pixel)" in console.file.getvalue()


def test_rays_of_every_status_are_counted_and_sum_up() -> None:
    status = np.zeros((HEIGHT, WIDTH))
    codes = [2, 3, 4, 5, 6, 7]
    status[0, 1:7] = codes
    metrics = metrics_of(status)
    rays = metrics["rays"]
    assert rays["launched"] == 200
    assert rays["hit"] == 180
    assert rays["missed"] == 20
    assert rays["good"] == 180 - len(codes)
    assert all(rays[Status(code).key] == 1 for code in codes)
    assert sum(rays[status.key] for status in Status) == rays["launched"]
    assert rays["open_boundary"] == 3
    counts = RayCounts(**{k: n for k, n in rays.items() if k != "launched"})
    assert percent(rays["blocked"], counts.met) == "0.6 %"
    left, right = metrics["regions"]["left"]["rays"], metrics["regions"]["right"]["rays"]
    assert left["hit"] == 90
    assert left["good"] == 84
    assert right["hit"] == right["good"] == 90


def test_metrics_use_good_rays_only_unless_asked() -> None:
    status = np.zeros((HEIGHT, WIDTH))
    status[-1, 18] = Status.INDEX_MISMATCH
    largest = AMOUNT[SEEN].max()
    second = np.sort(AMOUNT[SEEN])[-2]
    assert metrics_of(status)["displacement_mm"]["max"] == pytest.approx(second, rel=1e-6)
    both = metrics_of(status, include=(0, 5))
    assert both["displacement_mm"]["max"] == pytest.approx(largest, rel=1e-6)
    assert both["assumptions"] == {
        "engine": "by hand",
        "included_rays": ["good", "index_mismatch"],
    }
    assert metrics_of(status, include=(0, 5, 0))["assumptions"] == both["assumptions"]
    with pytest.raises(InputError, match="only 0 and 5"):
        metrics_of(include=(3,))


def leaves(value: Any) -> list[Any]:
    return [x for v in value.values() for x in leaves(v)] if isinstance(value, dict) else [value]


def test_fewer_than_100_rays_give_null_but_counts_stay() -> None:
    """Each region has 90 rays: too few, while the whole view has 180."""
    metrics = metrics_of()
    for region in metrics["regions"].values():
        assert region["rays"]["good"] == 90
        assert {key for key in metrics if key in region} >= {"displacement_mm", "coverage"}
        assert all(leaf is None for key in region if key != "rays" for leaf in leaves(region[key]))
    status = np.full((HEIGHT, WIDTH), int(Status.OUT_OF_FOCUS))
    status.flat[np.flatnonzero(SEEN)[:99]] = 0
    few = metrics_of(status)
    assert few["rays"]["good"] == 99
    assert few["coverage"] is None
    assert few["displacement_mm"]["median"] is None
    status.flat[np.flatnonzero(SEEN)[99]] = 0
    assert metrics_of(status)["displacement_mm"]["median"] is not None


def test_no_good_ray_at_all_is_no_error() -> None:
    metrics = metrics_of(np.full((HEIGHT, WIDTH), int(Status.GAVE_UP)))
    assert metrics["rays"]["gave_up"] == 180
    assert metrics["lateral_resolution_mm"] is None


def test_regions_hold_the_numbers_of_their_own_rays() -> None:
    """At twice the resolution each region has 360 rays; the left one has the smaller values."""
    view = CAMERA.scaled(2)
    column = np.arange(2 * WIDTH) + np.zeros((2 * HEIGHT, 1))
    image = make_image(
        view,
        PART,
        displacement=np.stack([0 * column, 0 * column, 1e-3 * (1 + column)], axis=-1),
        header=HEADER,
    )
    metrics = pose_metrics(image, PART).as_dict()
    left, right = metrics["regions"]["left"], metrics["regions"]["right"]
    assert left["displacement_mm"]["mean"] == pytest.approx(1e-3 * (1 + np.arange(2, 20).mean()))
    assert right["displacement_mm"]["max"] == pytest.approx(1e-3 * 38)
    assert left["coverage"] == right["coverage"] == 1.0
    whole = (left["displacement_mm"]["mean"] + right["displacement_mm"]["mean"]) / 2
    assert metrics["displacement_mm"]["mean"] == pytest.approx(whole)
    # Pixels are 0.5 mm; both plates are one smooth patch, so steps over their border count.
    assert left["lateral_resolution_mm"] == pytest.approx(0.5, rel=1e-5)
    assert set(left) == {key for key in metrics if key in left}


def test_header_entries_are_handed_on() -> None:
    metrics = metrics_of()
    assert metrics["schema"] == "iriftrace.pose/2"
    assert metrics["camera"] == CAMERA.as_dict()
    assert metrics["pose"] == HEADER["pose"]
    assert metrics["triangles_in_view"] == 77
    assert tuple(metrics["time_s"]) == TIMES
    assert metrics["time_s"]["straight"] == 0.25
    assert metrics["time_s"]["write"] is None


def test_a_later_stage_gives_other_metrics() -> None:
    """Its time enters the total; the metrics themselves cannot change."""
    image = make_image(CAMERA, PART, header=HEADER)
    first = pose_metrics(image, PART)
    later = first.with_time("write", 2.0).with_time("figures", 0.5)
    assert (later.time_s["write"], later.time_s["total"]) == (2.0, 2.5)
    assert first.time_s["write"] is first.time_s["total"] is None
    assert later.rays is first.rays


def test_other_parts_are_noticed() -> None:
    image = make_image(CAMERA, PART, header=HEADER)
    with pytest.raises(InputError, match="shows face 3, but by hand has only 2 faces"):
        pose_metrics(image, LEFT)
    other = make_image(CAMERA, PART, header={"part": {"sha256": "f" * 64}})
    with pytest.warns(IriftraceWarning, match="SHA-256 differs"):
        pose_metrics(other, PART)


def test_damaged_image_is_refused() -> None:
    image = make_image(CAMERA, PART, header=HEADER)
    image.channels["part.face"][3, 5] = 0
    with pytest.raises(InputError, match="1 good rays have no face"):
        pose_metrics(image, PART)


def test_json_is_plain_and_written_whole(tmp_path: Path) -> None:
    metrics = pose_metrics(make_image(CAMERA, PART, header=HEADER), PART)
    path = tmp_path / "pose.json"
    write_metrics(path, metrics)
    assert json.loads(path.read_text(encoding="utf-8")) == metrics.as_dict()
    before = path.read_bytes()
    for bad in (float("nan"), np.float64, object()):
        with pytest.raises(InputError, match="plain JSON"):
            write_metrics(path, evolve(metrics, assumptions={"bad": bad}))
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]

"""The script of docs/board.md on rendered pictures: dots found by OpenCV, then the fit."""

import runpy
import sys
from pathlib import Path

import attrs
import cv2
import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.special import erfc

import iriftrace
from validation.inputs.leaning_air import (
    BOARD,
    BOARD_CAMERA,
    UPRIGHT,
    hot_block_part,
    leaning,
    measured_shifts,
)

SCRIPT = Path(__file__).parents[2] / "docs" / "examples" / "board_shifts.py"
LEANS = (0.1, 0.2, 0.4, 0.5)
CAMERA = BOARD_CAMERA.scaled(0.6)
BOARD_TREE = cKDTree(BOARD.centres[:, :2])


def picture(places: np.ndarray, glow: float, seed: int) -> np.ndarray:
    """Grey values of pixels that see (n, 3) points of the board; NaN is the part, which glows."""
    local = (places - UPRIGHT[:3, 3]) @ UPRIGHT[:3, :3]
    distance, dot = BOARD_TREE.query(np.nan_to_num(local[:, :2], nan=1e6))
    dot = np.minimum(dot, len(BOARD.centres) - 1)
    # Blurred by 0.6 pixels.
    blur = 0.6 / 22.0
    ink = 0.5 * erfc((distance - 0.5 * BOARD.diameters[dot]) / (np.sqrt(2.0) * blur))
    grey = np.where(np.isfinite(local[:, 0]), 200.0 - 160.0 * ink, glow)
    noise = np.random.default_rng(seed).normal(0.0, 2.0, len(grey))
    width, height = CAMERA.resolution
    return np.clip(grey + noise, 0, 255).astype(np.uint8).reshape(height, width)


@pytest.mark.slow
@pytest.mark.usefixtures("variant")
@pytest.mark.filterwarnings("ignore:Hits of this view")
def test_pictures_to_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = iriftrace.Scene(
        BOARD.part.transformed(UPRIGHT),
        iriftrace.HotAir(leaning(0.3, tmp_path), layers=9),
        CAMERA,
        blockers=[hot_block_part()],
        engine="shells",
    )
    width, height = CAMERA.resolution
    column, row = np.meshgrid(np.arange(width), np.arange(height))
    hits = iriftrace.trace_rays(
        truth, *CAMERA.rays(np.column_stack((column.ravel(), row.ravel()))), coherent=True
    )
    for name, places, glow in (("cold", hits.straight, 60.0), ("hot", hits.refracted, 250.0)):
        seen = np.full((width * height, 3), np.nan)
        seen[hits.ray] = places
        cv2.imwrite(str(tmp_path / f"{name}.png"), picture(seen, glow, int(glow)))
    table = tmp_path / "shifts.csv"
    names = [str(tmp_path / f"{name}.png") for name in ("cold", "hot")]
    monkeypatch.setattr(sys, "argv", ["board_shifts.py", *names, "-o", str(table)])
    runpy.run_path(str(SCRIPT), run_name="__main__")
    assert "dots in" in capsys.readouterr().out
    found, exact = iriftrace.read_measured_shift(table), measured_shifts(truth, 0.0)
    distance, number = cKDTree(found.places).query(exact.places)
    # Every dot but those at the outline of the part, and none that is not there.
    there = distance < 1.0
    assert there.mean() > 0.95
    assert (distance[~there] > 20.0).all()
    assert distance[there].max() < 0.1
    error = found.shifts[number[there]] - exact.shifts[there]
    assert np.sqrt(np.mean(error**2)) < 0.03
    air = iriftrace.HotAir([leaning(lean, tmp_path) for lean in LEANS], layers=9)
    # A dot's picture is the mean of many rays, and so less noisy than one ray through shells.
    fit = iriftrace.fit_members(attrs.evolve(truth, air=air), found, noise_px=0.02)
    assert fit.contained
    assert fit.weights.weights @ LEANS == pytest.approx(0.3, abs=0.02)

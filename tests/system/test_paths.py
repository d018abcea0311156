"""Blanks, quotation marks, apostrophes and umlauts in the names of files and folders."""

import shutil
from pathlib import Path

import pytest
from failing import Run

from validation.inputs.hot_block import CAMERA, HotBlock


@pytest.mark.slow
def test_commands_accept_every_character_in_a_path(hot: HotBlock, run: Run) -> None:
    """From field and part to cloud, correction, plan and page; each name has another of them."""
    folder = Path('Kern\'s "heißer" teil')
    folder.mkdir()
    field, part = folder / 'luft "1".vtu', folder / f"teil's ä{hot.part.suffix}"
    shutil.copy(hot.field, field)
    shutil.copy(hot.part, part)
    scene = folder / "szene's ü" / 'die "eine".xml'
    second = ["--second", "40,-160,60"]
    run("scene", field, part, "-o", scene, "--layers=4", *CAMERA, *second)
    picture, cloud = folder / 'bild "a".exr', folder / "wolke's ö.ply"
    run("render", scene, "-o", picture)
    run("metrics", picture)
    run("measure", scene, "-o", cloud)
    corrected = folder / 'korrigiert "1".ply'
    run("correct", cloud, scene, "-o", corrected)
    run("report", corrected.with_suffix(".json"), "-o", folder / "seite's.html")
    sweep = folder / "fahrt's ä.nc"
    run("sweep", scene, "-o", sweep, "--azimuth=0:90:2", "--elevation=0:60:2", "--stand-off=150mm")
    run("plan", sweep)
    run("plot", sweep, "-o", folder / 'bilder "b"')
    named = {path.name for path in folder.iterdir()}
    assert {'bild "a".exr', 'korrigiert "1".ply', "seite's.html", 'bilder "b"'} <= named

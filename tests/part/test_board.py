"""The board of dots: its frame, and the sizes on its printed page, read back from the PDF."""

import re
import zlib
from pathlib import Path

import numpy as np
import pytest

from iriftrace.cli import main
from iriftrace.core.errors import InputError
from iriftrace.io.part_files import read_part
from iriftrace.part.board import LARGER, Board

MM = 72.0 / 25.4
"""Points of a PDF."""


def test_the_page_has_every_dot_and_bar_where_it_belongs(tmp_path: Path) -> None:
    command = "part board --size 120x80 --pitch 5 --dot 2 -o"
    assert main([*command.split(), str(tmp_path / "board.stl")]) == 0
    pdf = (tmp_path / "board.pdf").read_bytes()
    page = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ([\d.]+) \]", pdf)
    assert page is not None
    assert [float(size) / MM for size in page.groups()] == pytest.approx([120, 80], abs=1e-4)
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", pdf, re.DOTALL)
    drawn = max(map(_unpacked, streams), key=len).decode("latin-1")
    # Each dot is four curves from its lowest place.
    starts = re.findall(r"([-\d.]+) ([-\d.]+) m\s+[-\d. ]+ c", drawn)
    found = np.array(starts, dtype=float) / MM - (60.0, 40.0)
    table = np.genfromtxt(tmp_path / "board.csv", delimiter=",", names=True)
    assert len(found) == len(table) == len(Board((120, 80), 5, 2).centres)
    np.testing.assert_allclose(found[:, 0], table["x_mm"], atol=1e-4)
    np.testing.assert_allclose(found[:, 1], table["y_mm"] - table["diameter_mm"] / 2, atol=1e-4)
    # The scale bars: 50 mm across, 50 mm up.
    lines = re.findall(r"([-\d.]+) ([-\d.]+) m\s+([-\d.]+) ([-\d.]+) l", drawn)
    ends = np.array(lines, dtype=float) / MM
    lengths = np.abs(ends[:, 2:] - ends[:, :2])
    assert np.isclose(lengths, (50.0, 0.0), atol=1e-3).all(axis=1).sum() == 1
    assert np.isclose(lengths, (0.0, 50.0), atol=1e-3).all(axis=1).sum() == 1
    mesh = read_part(tmp_path / "board.stl")
    np.testing.assert_allclose(mesh.bounds, ((-60, -40, -5), (60, 40, 0)), atol=1e-6)


def _unpacked(stream: bytes) -> bytes:
    try:
        return zlib.decompress(stream)
    except zlib.error:
        return stream


def test_marks_tell_right_from_up() -> None:
    board = Board((120.0, 80.0), 4.0)
    large = board.centres[board.diameters > board.dot_mm]
    assert {tuple(place) for place in large.tolist()} == {(0, 0, 0), (8, 0, 0), (0, 4, 0)}
    assert board.diameters.max() == pytest.approx(LARGER * 2.0)
    assert (np.abs(board.centres) < (60.0, 40.0, 1.0)).all()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (("--size", "300"), "width and height in mm"),
        (("--size", "20x20"), "change size or pitch"),
        (("--pitch", "0"), "positive length"),
        (("--dot", "2.5"), "touch their neighbours"),
    ],
)
def test_boards_that_cannot_be(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], wrong: tuple[str, str], words: str
) -> None:
    assert main(["part", "board", "-o", str(tmp_path / "b.stl"), *wrong]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError):
        Board(dot_mm=2.5)

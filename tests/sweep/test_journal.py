"""Work that is interrupted goes on and gives the same file; what was done is not done again."""

import sqlite3
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from iriftrace.core.errors import InputError
from iriftrace.io.netcdf import read_netcdf
from iriftrace.sweep.journal import Journal, Piece, Progress, Work, journal_of, open_journal
from iriftrace.sweep.pose import fingerprint

REQUEST = {"study": "squares", "count": 5}
SCHEMA = "squares/1"


def read_study(path: Path) -> xr.Dataset:
    return read_netcdf(path, "study", SCHEMA)


def run_cases(
    out: Path,
    request: dict[str, Any],
    count: int,
    measure: Callable[[int], dict[str, Any]],
    progress: Progress | None = None,
) -> xr.Dataset:
    """Squares of numbers, as a study keeps its cases."""
    work = Work("study", "files or options", out, fingerprint(request), count)

    def left(journal: Journal) -> Iterator[Piece]:
        for number in range(count):
            if number not in journal:
                yield Piece(number, measure(number), np.arange(number))

    def write(journal: Journal) -> None:
        for number in range(count):
            np.testing.assert_array_equal(journal.rows(number), np.arange(number))
        squares = np.array([journal.entry(number)["square"] for number in range(count)])
        dataset = xr.Dataset({"square": (("n",), squares)})
        dataset.attrs |= {"schema": SCHEMA, "request": work.request}
        dataset.to_netcdf(out, engine="h5netcdf")

    return work.run(left, write, read_study, progress)


def square(number: int) -> dict[str, Any]:
    return {"square": number * number}


def test_an_interrupted_study_goes_on_where_it_stopped(tmp_path: Path) -> None:
    measured: list[int] = []
    interruptions = iter([True])
    progress: list[tuple[int, int]] = []

    def measure(number: int) -> dict[str, Any]:
        if number == 3 and next(interruptions, False):
            raise KeyboardInterrupt
        measured.append(number)
        return square(number)

    out = tmp_path / "squares.nc"
    with pytest.raises(KeyboardInterrupt):
        run_cases(out, REQUEST, 5, measure)
    assert not out.exists()
    found = run_cases(out, REQUEST, 5, measure, lambda done, of: progress.append((done, of)))
    assert measured == [0, 1, 2, 3, 4]
    assert progress == [(3, 5), (4, 5), (5, 5)]
    np.testing.assert_array_equal(found["square"], [0, 1, 4, 9, 16])
    assert [path.name for path in tmp_path.iterdir()] == ["squares.nc"]


def test_a_finished_study_is_read_and_not_measured_again(tmp_path: Path) -> None:
    out = tmp_path / "squares.nc"
    run_cases(out, REQUEST, 5, square)
    before = out.read_bytes()

    def never(number: int) -> dict[str, Any]:
        raise AssertionError(number)

    again = run_cases(out, REQUEST, 5, never)
    np.testing.assert_array_equal(again["square"], [0, 1, 4, 9, 16])
    assert out.read_bytes() == before


def test_another_study_is_never_replaced(tmp_path: Path) -> None:
    out = tmp_path / "squares.nc"
    run_cases(out, REQUEST, 5, square)
    with pytest.raises(InputError, match="study of other files or options"):
        run_cases(out, {**REQUEST, "count": 6}, 6, square)
    text = tmp_path / "text.nc"
    text.write_text("somebody's work")
    with pytest.raises(InputError, match="already exists and is not a study"):
        run_cases(text, REQUEST, 5, square)
    assert text.read_text() == "somebody's work"
    assert not journal_of(text).exists()


def test_a_journal_is_of_one_study_and_of_one_program(tmp_path: Path) -> None:
    """Somebody forgot the first terminal; or it was killed after the result was written."""

    def stop(number: int) -> dict[str, Any]:
        if number:
            raise KeyboardInterrupt
        return square(number)

    out = tmp_path / "squares.nc"
    with pytest.raises(KeyboardInterrupt):
        run_cases(out, REQUEST, 5, stop)
    with pytest.raises(InputError, match="belongs to a study of other"):
        run_cases(out, {**REQUEST, "count": 6}, 6, square)
    with (
        open_journal(Work("study", "files", out, fingerprint(REQUEST), 5)),
        pytest.raises(InputError, match="Another program is writing"),
    ):
        run_cases(out, REQUEST, 5, square)
    left = journal_of(out).read_bytes()
    run_cases(out, REQUEST, 5, square)
    journal_of(out).write_bytes(left)
    run_cases(out, REQUEST, 5, square)
    assert [path.name for path in tmp_path.iterdir()] == ["squares.nc"]


def test_structured_rows_come_back_and_strangers_files_are_left_alone(tmp_path: Path) -> None:
    work = Work("study", "files", tmp_path / "a.nc", "request", 2)
    rows = np.array([(1, 2.5), (3, -0.5)], dtype=[("face", "i4"), ("value", "f4")])
    with open_journal(work) as journal:
        journal.add(Piece(1, {"a": None}, rows))
    with open_journal(work) as journal:
        assert list(journal) == [1]
        np.testing.assert_array_equal(journal.rows(1), rows)
        assert journal.entry(1) == {"a": None}
        journal.clear()
    assert not list(tmp_path.iterdir())
    stranger = tmp_path / "a.nc.partial"
    stranger.write_text("somebody's notes")
    with pytest.raises(InputError, match="cannot be read"), open_journal(work):
        pass
    assert stranger.read_text() == "somebody's notes"


def test_reading_says_what_is_wrong(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="`iriftrace study` writes"):
        read_study(tmp_path / "gone.nc")
    other = tmp_path / "other.nc"
    xr.Dataset({"a": 1}).to_netcdf(other, engine="h5netcdf")
    with pytest.raises(InputError, match="schema"):
        read_study(other)


def _read_piece(work: Work) -> None:
    with open_journal(work) as journal:
        journal.entry(0)
        journal.rows(0)


@pytest.mark.parametrize("column", ["entry", "rows"])
def test_a_damaged_piece_is_named(tmp_path: Path, column: str) -> None:
    work = Work("sweep", "poses", tmp_path / "a.nc", "request", 1)
    with open_journal(work) as journal:
        journal.add(Piece(0, {"pose": 0}, np.arange(3.0)))
    connection = sqlite3.connect(journal_of(work.output))
    connection.execute(f"UPDATE piece SET {column} = ?", (b"\x93NUMPY",))
    connection.commit()
    connection.close()
    with pytest.raises(InputError, match=r"cannot be read \(piece 0: "):
        _read_piece(work)


def test_a_damaged_journal_is_refused(tmp_path: Path) -> None:
    work = Work("sweep", "poses", tmp_path / "a.nc", "request", 2)
    with open_journal(work) as journal:
        journal.add(Piece(0, {"pose": 0}))
    file = journal_of(work.output)
    file.write_bytes(b"nonsense" + file.read_bytes()[8:])
    with pytest.raises(InputError, match="cannot be read"), open_journal(work):
        pass

"""Long work that may be killed: finished pieces in an SQLite file next to the future result."""

from __future__ import annotations

import io
import json
import sqlite3
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from attrs import frozen

from iriftrace.core.arrays import AnyArray
from iriftrace.core.errors import InputError
from iriftrace.core.files import array_in
from iriftrace.core.plain import JsonObject
from iriftrace.io.refusals import damaged

if TYPE_CHECKING:
    import xarray as xr

SCHEMA = "iriftrace.journal/1"

Progress = Callable[[int, int], None]
"""Called with the number of finished pieces and of all."""


@frozen(eq=False)
class Piece:
    """One finished piece of a work: a pose of a sweep, for example.

    Its entry is plain JSON values; its rows are of numbers, or structured.
    """

    number: int
    entry: JsonObject
    rows: AnyArray | None = None


@frozen(eq=False)
class Work:
    """A number of pieces, `total`, that together form one netCDF file.

    Messages use its kind ("sweep") and what distinguishes it from others ("poses, another scene or
    other options"). The request is a fingerprint of everything that the pieces depend on.
    """

    kind: str
    parts: str
    output: Path
    request: str
    total: int

    def run(
        self,
        measure: Callable[[Journal], Iterable[Piece]],
        write: Callable[[Journal], None],
        read: Callable[[Path], xr.Dataset],
        progress: Progress | None = None,
    ) -> xr.Dataset:
        """Measure the pieces that are still missing, write the result and read it.

        `measure` yields the pieces that are not in the journal, in any order; `write` writes the
        result, including its attribute ``request``. Every piece enters the journal as soon as it is
        measured, so that the same call continues where a killed one stopped. The journal is removed
        when the result is written. An existing result is read and nothing is measured.

        Raises InputError if the file or its journal belongs to another work or cannot be written,
        or another program is writing it.
        """
        if not self.output.parent.is_dir():
            raise InputError(
                f"The folder {self.output.parent} does not exist; create it first.",
                code="folder.missing",
                argument="output",
            )
        if self.output.is_file():
            finished = self._finished(read)
            if journal_of(self.output).is_file():
                # Killed after the result was written; the journal of another work is not ours.
                with suppress(InputError), open_journal(self) as journal:
                    journal.clear()
            return finished
        with open_journal(self) as journal:
            if progress is not None:
                progress(len(journal), self.total)
            for piece in measure(journal):
                journal.add(piece)
                if progress is not None:
                    progress(len(journal), self.total)
            write(journal)
            journal.clear()
        return read(self.output)

    def _finished(self, read: Callable[[Path], xr.Dataset]) -> xr.Dataset:
        advice = "delete it, or give another name"
        try:
            dataset = read(self.output)
        except InputError as error:
            raise InputError(
                f"{self.output} already exists and is not a {self.kind}; {advice}.",
                code="output.other_content",
                argument="output",
            ) from error
        if dataset.attrs.get("request") != self.request:
            dataset.close()
            raise InputError(
                f"{self.output} holds a {self.kind} of other {self.parts}; {advice}.",
                code="output.other_work",
                argument="output",
            )
        return dataset


class Journal:
    """The finished pieces of a work; as a collection it holds their numbers.

    Each piece is one transaction of SQLite's write-ahead log. Committed pieces survive any end of
    the program, and a power failure loses at most the last pieces. The exclusive lock ends with
    the process. Only the number of each piece is in memory.
    """

    def __init__(self, connection: sqlite3.Connection, work: Work) -> None:
        self._connection = connection
        # With the exclusive lock set first, the log needs no shared memory, which does not exist
        # on network file systems.
        connection.execute("PRAGMA locking_mode = EXCLUSIVE")
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = NORMAL")
        connection.execute("BEGIN EXCLUSIVE")
        if connection.execute("SELECT count(*) FROM sqlite_master").fetchone() == (0,):
            connection.execute("CREATE TABLE work (schema TEXT, request TEXT)")
            connection.execute("INSERT INTO work VALUES (?, ?)", (SCHEMA, work.request))
            connection.execute(
                "CREATE TABLE piece (number INTEGER PRIMARY KEY, entry TEXT, rows BLOB)"
            )
        connection.execute("COMMIT")
        if connection.execute("SELECT * FROM work").fetchone() != (SCHEMA, work.request):
            raise InputError(
                f"{journal_of(work.output)} belongs to a {work.kind} of other {work.parts}; delete "
                "it, or give another name.",
                code="output.other_work",
                argument="output",
            )
        self._numbers = {number for (number,) in connection.execute("SELECT number FROM piece")}

    def __len__(self) -> int:
        return len(self._numbers)

    def __iter__(self) -> Iterator[int]:
        return iter(self._numbers)

    def __contains__(self, number: object) -> bool:
        return number in self._numbers

    def add(self, piece: Piece) -> None:
        """Record a piece."""
        blob = None
        if piece.rows is not None:
            buffer = io.BytesIO()
            np.save(buffer, piece.rows, allow_pickle=False)
            blob = buffer.getvalue()
        self._connection.execute(
            "INSERT INTO piece VALUES (?, ?, ?)", (piece.number, json.dumps(piece.entry), blob)
        )
        self._numbers.add(piece.number)

    def entry(self, number: int) -> JsonObject:
        """The JSON values of a piece."""
        try:
            entry: JsonObject = json.loads(self._stored("entry", number))
        except (ValueError, TypeError, RecursionError) as error:
            raise sqlite3.DatabaseError(f"piece {number}: {error}") from error
        return entry

    def rows(self, number: int) -> AnyArray | None:
        """The array of a piece."""
        blob = self._stored("rows", number)
        try:
            return None if blob is None else array_in(blob)
        except (ValueError, TypeError) as error:
            raise sqlite3.DatabaseError(f"piece {number}: {error}") from error

    def _stored(self, column: str, number: int) -> Any:
        row = self._connection.execute(
            f"SELECT {column} FROM piece WHERE number = ?", (number,)
        ).fetchone()
        if row is None:
            raise sqlite3.DatabaseError(f"piece {number} is listed but not there")
        return row[0]

    def clear(self) -> None:
        """Remove the pieces, because they are in the result."""
        self._numbers.clear()


def journal_of(output: Path) -> Path:
    """File of the journal next to a result."""
    return output.with_name(output.name + ".partial")


@contextmanager
def open_journal(work: Work) -> Iterator[Journal]:
    """Journal of a work, for one program at a time; without pieces it is removed at the end.

    Raises InputError if another program is writing it, it belongs to another work, or the file is
    damaged or cannot be written.
    """
    path = journal_of(work.output)
    try:
        connection = sqlite3.connect(path, timeout=0, isolation_level=None)
        journal = None
        try:
            journal = Journal(connection, work)
            yield journal
        finally:
            connection.close()
            if journal is not None and not journal:
                path.unlink()
    # For damaged names of columns and texts sqlite3 reports that they are not UTF-8.
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise _reason(error, path, work.kind) from error


def _reason(error: Exception, path: Path, kind: str) -> InputError:
    code = getattr(error, "sqlite_errorcode", None)
    if code == sqlite3.SQLITE_BUSY:
        return InputError(
            f"Another program is writing the {kind} in {path}; wait for it, stop it, or give "
            "another name.",
            code="output.busy",
            argument="output",
        )
    if code in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR_WRITE):
        return InputError(
            f"The disk has no room for {path} ({error}); make room and give the same command "
            "again: no finished piece is lost.",
            code="disk.full",
        )
    if code in (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_PERM):
        return InputError(
            f"The {kind} needs the file {path} while it runs, which cannot be written ({error}); "
            "remove the obstacle, or give another name.",
            code="output.unwritable",
            argument="output",
        )
    return damaged(path, error, f"delete it to start the {kind} again")

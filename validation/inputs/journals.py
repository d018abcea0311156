"""Read journals of running or killed programs."""

from __future__ import annotations

import shutil
import sqlite3
import tempfile
from pathlib import Path


def pieces_done(journal: Path) -> int:
    """Finished pieces in the journal that a kill would leave at this moment.

    The program that writes has the file locked, so a copy is read; one of two files that do not
    belong together holds nothing for sure.
    """
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / journal.name
        for suffix in ("", "-wal"):
            file = journal.with_name(journal.name + suffix)
            try:
                shutil.copyfile(file, copy.with_name(file.name))
            except FileNotFoundError:
                continue
        connection = sqlite3.connect(copy)
        try:
            (count,) = connection.execute("SELECT count(*) FROM piece").fetchone()
        except sqlite3.DatabaseError:
            return 0
        finally:
            connection.close()
    return int(count)

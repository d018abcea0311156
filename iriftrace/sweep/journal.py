"""The finished poses of a sweep that is not finished yet, safe from whatever happens next."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

import numpy as np

from iriftrace.core.errors import InputError
from iriftrace.core.files import whole_file
from iriftrace.image.sightings import NOTHING_SEEN, FaceSightings
from iriftrace.sweep.pose import PoseResult

SCHEMA = "iriftrace.sweep-journal/1"
POSES = "poses.jsonl"
LOCK = "lock"


class Journal:
    """A folder with one line of JSON for each finished pose and one file with what it sees.

    A pose's file is complete before its line is begun, so a line that is whole means a pose that is
    done. Of each pose only the place of its line is kept in memory. As a collection it holds the
    numbers of the finished poses.

    Parameters
    ----------
    folder : Path
    request : str
        Fingerprint of scenes, poses and options; a journal of another sweep is refused.
    what : str
        What it is of, in messages: a ``"sweep"``, or a ``"study"``, whose cases are the poses.

    Raises
    ------
    InputError
        If the folder holds the journal of another sweep, or a damaged one.
    """

    def __init__(self, folder: Path, request: str, what: str = "sweep") -> None:
        self.folder = folder
        self._what = what
        self._request = request
        self._place: dict[int, int] = {}
        self._faces: dict[int, int] = {}
        self._end = 0
        self._read()

    def __len__(self) -> int:
        return len(self._place)

    def __iter__(self) -> Iterator[int]:
        return iter(self._place)

    def __contains__(self, pose: object) -> bool:
        return pose in self._place

    def add(self, result: PoseResult) -> None:
        """Record a pose."""
        faces = len(result.sightings)
        if faces:
            with whole_file(self._file(result.number)) as temporary, temporary.open("wb") as file:
                np.save(file, result.sightings.as_rows(), allow_pickle=False)
                _flush(file)
        with (self.folder / POSES).open("rb+" if self._end else "wb") as file:
            if not self._end:
                self._end += file.write(_line({"schema": SCHEMA, "request": self._request}))
            file.seek(self._end)
            # What follows was being written when an earlier run was killed.
            file.truncate()
            written = file.write(_line({"pose": result.number, "faces": faces, **result.entry}))
            _flush(file)
        self._remember(result.number, faces, written)

    def entry(self, pose: int) -> dict[str, Any]:
        """What a pose was recorded with."""
        with (self.folder / POSES).open("rb") as file:
            file.seek(self._place[pose])
            entry: dict[str, Any] = json.loads(file.readline())
        return entry

    def sightings(self, pose: int) -> FaceSightings:
        """Which faces a pose sees."""
        if not self._faces[pose]:
            return NOTHING_SEEN
        return FaceSightings.from_rows(np.load(self._file(pose), allow_pickle=False))

    def close(self) -> None:
        """Give the poses up, because they are in the result now."""
        (self.folder / POSES).unlink()

    def _file(self, pose: int) -> Path:
        return self.folder / f"faces_{pose:06d}.npy"

    def _remember(self, pose: int, faces: int, length: int) -> None:
        self._place[pose] = self._end
        self._faces[pose] = faces
        self._end += length

    def _read(self) -> None:
        if not (self.folder / POSES).is_file():
            return
        with (self.folder / POSES).open("rb") as file:
            for line in file:
                # A line without its end was being written when the program was killed.
                if not line.endswith(b"\n"):
                    break
                try:
                    values = json.loads(line)
                    if self._end:
                        pose, faces = int(values["pose"]), int(values["faces"])
                    else:
                        request = str(values["request"])
                except (ValueError, TypeError, KeyError) as error:
                    raise InputError(
                        f"{file.name} is damaged ({error}); delete the folder {self.folder} to "
                        f"start the {self._what} again."
                    ) from error
                if self._end:
                    self._remember(pose, faces, len(line))
                else:
                    self._check(request)
                    self._end = len(line)

    def _check(self, request: str) -> None:
        if request != self._request:
            raise InputError(
                f"{self.folder} belongs to a {self._what} of other poses, another scene or other "
                "options; delete it, or give another name with -o."
            )


def journal_of(output: Path) -> Path:
    """Folder of the journal beside a result."""
    return output.with_name(output.name + ".journal")


def remove_leftovers(folder: Path, request: str) -> None:
    """Remove the journal of a sweep whose result is there, if it was killed before it could."""
    if folder.is_dir():
        # The journal of another sweep is not ours.
        with suppress(InputError):
            Journal(folder, request)
            shutil.rmtree(folder, ignore_errors=True)


@contextmanager
def sole_writer(folder: Path, what: str = "sweep") -> Iterator[None]:
    """Make sure that no other process goes on with the same journal.

    The lock ends with the process, however that ends. A folder without a finished pose is removed
    at the end of the block.

    Raises
    ------
    InputError
        If another process has the lock, or the folder cannot be made.
    """
    try:
        folder.mkdir(exist_ok=True)
        file = (folder / LOCK).open("ab")
    except OSError as error:
        raise InputError(
            f"The {what} needs the folder {folder} while it runs, which cannot be made "
            f"({error.strerror}); remove what is there, or give another name with -o."
        ) from error
    locked = False
    try:
        with file:
            _lock(file, folder, what)
            locked = True
            yield
    finally:
        if locked and not (folder / POSES).exists():
            shutil.rmtree(folder, ignore_errors=True)


def _lock(file: IO[bytes], folder: Path, what: str) -> None:
    try:
        if sys.platform == "win32":
            import msvcrt

            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise InputError(
            f"Another program is writing the {what} in {folder} ({error.strerror}); wait for it, "
            "stop it, or give another name with -o."
        ) from error


def _line(values: dict[str, Any]) -> bytes:
    return (json.dumps(values) + "\n").encode()


def _flush(file: IO[bytes]) -> None:
    file.flush()
    os.fsync(file.fileno())

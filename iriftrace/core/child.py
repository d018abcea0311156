"""Read files in a child process; a crash, timeout or memory overrun raises `ChildError`.

Libraries trust the header of a file: a damaged file can crash the process that reads it, run for
ever or fill the memory. One process reads file after file and imports the readers' libraries once;
after a crash the next file gets a new process.
"""

from __future__ import annotations

import atexit
import faulthandler
import json
import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress
from importlib import import_module
from threading import Lock
from typing import IO, TYPE_CHECKING, Any

import numpy as np
import psutil

if TYPE_CHECKING:
    from iriftrace.core.arrays import AnyArray
    from iriftrace.core.plain import JsonObject

_SECONDS, _BYTES_A_SECOND = 5, 1_000_000
"""Processor time for a file: small ones take 0.1 s, and text, the slowest, 10 MB a second."""

_MEMORY, _MEMORY_A_BYTE = 3 << 30, 64
"""Memory for a file: VTK's libraries take up to 1 GB, and compression packs fields 3 to 20 times.

A file that packs better than 64 times and is larger than 2 GB does not hold a solver's field.
"""

_PATIENCE = 10
"""Hours on the clock for one of processor time, on a busy machine."""

_POLL = 0.1  # s

_TOO_LARGE = "it needs more memory than it may take"

_ARRAY = "\0"
"""Key of an array's type and shape in JSON; no name in a file has it."""


class ChildError(Exception):
    """Why a child process failed, as half a sentence."""


def read_in_child(function: str, size: int, *arguments: object) -> Any:
    """Call a function, ``"module:name"``, in a child process.

    The arguments are JSON values; it returns such values, among which can be arrays of numbers.
    `size` are the bytes that it reads; they set the limits of time and memory. Raises ChildError if
    the function raises an error, exceeds its limits or crashes.
    """
    seconds, memory = _SECONDS + size // _BYTES_A_SECOND, _MEMORY + _MEMORY_A_BYTE * size
    answer = _reader.ask(json.dumps([function, arguments, seconds]).encode(), seconds, memory)
    if "error" in answer:
        raise ChildError(answer["error"])
    return answer["value"]


class _Process:
    """One process that reads until it is ended, or breaks down."""

    def __init__(self) -> None:
        self.owner = os.getpid()
        self.running = subprocess.Popen(
            # -P: no modules are imported from the working folder.
            [sys.executable, "-P", "-m", "iriftrace.core.child"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            # Ctrl-C is for the parent, which ends the child. Windows knows the flag only.
            start_new_session=True,
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )

    def usable(self) -> bool:
        """Whether it runs and belongs to this process, not to the one that this is a fork of."""
        return self.owner == os.getpid() and self.running.poll() is None

    def ask(self, request: bytes, seconds: int, memory: int) -> JsonObject | None:
        """Answer to a request, None if the process breaks down; ChildError beyond the limits."""
        asked, answers = self.running.stdin, self.running.stdout
        assert asked is not None
        assert answers is not None
        with ThreadPoolExecutor(1) as threads:
            try:
                with suppress(OSError):  # it has broken down
                    asked.write(request + b"\n")
                    asked.flush()
                # Its libraries are imported before a line that is empty.
                ready = threads.submit(answers.readline)
                while not wait([ready], _POLL).done:
                    pass
                before = self._used()
                answer = threads.submit(_received, answers)
                while not wait([answer], _POLL).done:
                    time, held = np.subtract(self._used(), before)
                    if time > seconds:
                        raise ChildError(f"its reader is still busy with it after {seconds} s")
                    if held > memory:
                        raise ChildError(_TOO_LARGE)
            except BaseException:
                self.running.kill()  # which ends the thread
                raise
            return answer.result()

    def _used(self) -> tuple[float, int]:
        """Processor time (s) and memory (bytes) so far; none of a process that has ended."""
        try:
            process = psutil.Process(self.running.pid)
            times = process.cpu_times()
            return times.user + times.system, process.memory_info().rss
        except psutil.Error:
            return 0.0, 0

    def end(self) -> int:
        """End it, whatever it is reading; its exit code."""
        self.running.kill()
        with self.running:  # closes the pipes
            return self.running.wait()


class _Reader:
    """Starts the process when it is first needed, and a new one after a failure."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._process: _Process | None = None

    def ask(self, request: bytes, seconds: int, memory: int) -> JsonObject:
        """Answer to a request; ChildError if there is none within the limits."""
        with self._lock:
            used = self._process is not None and self._process.usable()
            answer, code = self._asked(request, seconds, memory)
            if answer is None and used:
                # What an earlier file left in the process may be the reason.
                answer, code = self._asked(request, seconds, memory)
        if answer is None:
            name = signal.Signals(-code).name if code < 0 else f"exit status {code}"
            raise ChildError(f"its reader broke down, {name}")
        return answer

    def _asked(self, request: bytes, seconds: int, memory: int) -> tuple[JsonObject | None, int]:
        """Answer, or None and the exit code of the process that broke down."""
        if self._process is None or not self._process.usable():
            self.stop()
            self._process = _Process()
        try:
            answer = self._process.ask(request, seconds, memory)
        except BaseException:
            # An answer that is still pending must not be read as the next one.
            self.stop()
            raise
        return answer, 0 if answer is not None else self.stop()

    def stop(self) -> int:
        """End the process, if there is one of this process; its exit code."""
        process, self._process = self._process, None
        return process.end() if process is not None and process.owner == os.getpid() else 0


_reader = _Reader()
atexit.register(_reader.stop)


def _received(answers: IO[bytes]) -> JsonObject | None:
    """What `_answer` wrote: a line of JSON, and the bytes of its arrays; None if cut short."""
    arrays: list[AnyArray] = []

    def made(values: JsonObject) -> JsonObject | AnyArray:
        if _ARRAY not in values:
            return values
        kind, shape = values[_ARRAY]
        arrays.append(np.empty(shape, dtype=kind))
        return arrays[-1]

    line = answers.readline()
    if not line.endswith(b"\n"):
        return None
    value: JsonObject = json.loads(line, object_hook=made)
    for array in filter(np.size, arrays):
        if answers.readinto(array.data.cast("B")) != array.nbytes:  # type: ignore[attr-defined]
            return None
    return value


def _answer(out: IO[bytes], function: str, arguments: Sequence[object]) -> None:
    arrays: list[AnyArray] = []

    def placeholder(array: AnyArray) -> JsonObject:
        arrays.append(np.ascontiguousarray(array))
        return {_ARRAY: [array.dtype.str, array.shape]}

    module, _, name = function.partition(":")
    work = getattr(import_module(module), name)
    out.write(b"\n")
    out.flush()
    try:
        head = json.dumps({"value": work(*arguments)}, default=placeholder)
    except Exception as error:  # libraries that read files raise any
        arrays.clear()
        head = json.dumps({"error": " ".join(str(error).split()) or _TOO_LARGE})
    out.write(head.encode() + b"\n")
    for array in filter(np.size, arrays):
        out.write(array.data)
    out.flush()


def _serve() -> None:
    """Answer the requests of standard input, a line each, until it ends."""
    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)  # libraries may print
        for line in sys.stdin.buffer:
            function, arguments, seconds = json.loads(line)
            # Ends the process, should the parent be killed while a library runs for ever.
            faulthandler.dump_traceback_later(_PATIENCE * seconds, exit=True)
            _answer(answers, function, arguments)
            faulthandler.cancel_dump_traceback_later()


if __name__ == "__main__":
    _serve()

"""Read files in a child process; a crash, timeout or memory overrun raises `ChildError`.

Libraries trust the header of a file: a damaged file can crash the process that reads it, run for
ever or fill the memory. One process reads file after file and imports the readers' libraries once;
after a crash the next file gets a new process. Requests and answers are JSON, each on a line, and
the bytes of an answer's arrays follow it: nothing that such a process sends is unpickled.
"""

from __future__ import annotations

import atexit
import faulthandler
import json
import math
import os
import signal
import subprocess
import sys
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

_children: dict[int, subprocess.Popen[bytes]] = {}
"""Child of each process, by the number of the process: a fork must not use that of its parent."""

_lock = Lock()


class ChildError(Exception):
    """Why a child process failed, as half a sentence."""


def read_in_child(function: str, size: int, *arguments: object) -> Any:
    """Call a function, ``"module:name"``, in a child process.

    The arguments are JSON values; it returns such values, among which can be arrays of numbers.
    `size` are the bytes that it reads; they set the limits of time and memory. Raises ChildError if
    the function raises an error, exceeds its limits or crashes.
    """
    seconds, memory = _SECONDS + size // _BYTES_A_SECOND, _MEMORY + _MEMORY_A_BYTE * size
    # Relative paths are of the folder in which the caller works now.
    request = json.dumps([function, arguments, seconds, os.getcwd()]).encode() + b"\n"
    with _lock:
        child, answer = _children.get(os.getpid()), None
        if child is not None:
            answer = _ask(child, request, seconds, memory)
        if answer is None:
            # Also after a breakdown, whose reason may be what an earlier file left in the process.
            answer = _ask(_start(), request, seconds, memory)
        if answer is None:
            code = _stop()
            name = signal.Signals(-code).name if code < 0 else f"exit status {code}"
            raise ChildError(f"its reader broke down, {name}")
    value, error = answer
    if error:
        raise ChildError(error)
    return value


def _start() -> subprocess.Popen[bytes]:
    """Start this process's child, in place of the one that it may have."""
    _stop()
    _children[os.getpid()] = child = subprocess.Popen(
        # -P: no modules are imported from the working folder.
        [sys.executable, "-P", "-m", "iriftrace.core.isolated"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        # Ctrl-C is for the parent, which ends the child. Windows knows the flag only.
        start_new_session=True,
        creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
    )
    return child


@atexit.register
def _stop() -> int:
    """End this process's child, whatever it is reading; its exit code."""
    child = _children.pop(os.getpid(), None)
    if child is None:
        return 0
    with suppress(OSError), child:  # closes the pipes, and a broken one is an error
        child.kill()
    return child.wait()


def _ask(
    child: subprocess.Popen[bytes], request: bytes, seconds: int, memory: int
) -> tuple[Any, str] | None:
    """Value and error of a request, None if the child breaks down; ChildError beyond the limits."""
    assert child.stdin is not None
    assert child.stdout is not None
    with ThreadPoolExecutor(1) as threads:
        try:
            with suppress(OSError):  # it has broken down
                child.stdin.write(request)
                child.stdin.flush()
            # Its libraries are imported before a line that is empty.
            ready = threads.submit(child.stdout.readline)
            while not wait([ready], _POLL).done:
                pass
            before = _used(child.pid)
            answer = threads.submit(_received, child.stdout)
            while not wait([answer], _POLL).done:
                time, held = np.subtract(_used(child.pid), before)
                if time > seconds:
                    raise ChildError(f"its reader is still busy with it after {seconds} s")
                if held > memory:
                    raise ChildError(_TOO_LARGE)
            return answer.result()
        except BaseException:
            # Also ends the thread; a pending answer must not be read as the next one.
            _stop()
            raise


def _used(pid: int) -> tuple[float, int]:
    """Processor time (s) and memory (bytes) so far; none of a process that has ended."""
    try:
        process = psutil.Process(pid)
        times = process.cpu_times()
        return times.user + times.system, process.memory_info().rss
    except psutil.Error:
        return 0.0, 0


def _received(answers: IO[bytes]) -> tuple[Any, str] | None:
    """Value and error that `_serve` wrote; None if they are cut short or damaged."""

    def made(values: JsonObject) -> JsonObject | AnyArray:
        if _ARRAY not in values:
            return values
        kind, shape = values[_ARRAY]
        content = bytearray(math.prod(shape) * np.dtype(kind).itemsize)
        if answers.readinto(content) != len(content):  # type: ignore[attr-defined]
            raise EOFError
        return np.frombuffer(content, kind).reshape(shape)

    try:
        value, error = json.loads(answers.readline(), object_hook=made)
    except MemoryError:
        raise ChildError(_TOO_LARGE) from None
    except Exception:  # a process that a file has damaged can write anything
        return None
    return value, error


def _serve() -> None:
    """Answer the requests of standard input, a line each, until it ends."""
    arrays: list[AnyArray] = []

    def placeholder(array: AnyArray) -> JsonObject:
        arrays.append(np.ascontiguousarray(array))
        return {_ARRAY: [array.dtype.str, array.shape]}

    with os.fdopen(os.dup(1), "wb") as answers:
        os.dup2(2, 1)  # libraries may print
        for line in sys.stdin.buffer:
            function, arguments, seconds, folder = json.loads(line)
            os.chdir(folder)
            # Ends the process, should the parent be killed while a library runs for ever.
            faulthandler.dump_traceback_later(_PATIENCE * seconds, exit=True)
            module, _, name = function.partition(":")
            work = getattr(import_module(module), name)
            answers.write(b"\n")
            answers.flush()
            try:
                head = json.dumps([work(*arguments), ""], default=placeholder)
            except Exception as error:  # libraries that read files raise any
                arrays.clear()
                head = json.dumps([None, " ".join(str(error).split()) or _TOO_LARGE])
            answers.write(head.encode() + b"\n")
            for array in arrays:
                answers.write(array.data)
            answers.flush()
            arrays.clear()
            faulthandler.cancel_dump_traceback_later()


if __name__ == "__main__":
    _serve()

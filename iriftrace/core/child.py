"""Read files in a child process; a crash, timeout or memory overrun raises `ChildError`.

Libraries trust the header of a file: a damaged file can crash the process that reads it, run for
ever or fill the memory. One server imports a reader's libraries and forks for each file, so a
crash does not affect the next file.
"""

from __future__ import annotations

import atexit
import json
import os
import resource
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from threading import Lock
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

if TYPE_CHECKING:
    from iriftrace.core.arrays import AnyArray
    from iriftrace.core.plain import JsonObject

_SECONDS, _BYTES_A_SECOND = 5, 1_000_000
"""Processor time of a child: small files take 0.1 s, and text, the slowest, 10 MB a second."""

_MEMORY, _MEMORY_A_BYTE = 3 << 30, 64
"""Address space of a child: VTK's libraries take 1 GB, and compression packs fields 3 to 20 times.

A file that packs better than 64 times and is larger than 2 GB does not hold a solver's field.
"""

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
    answer, status = _server.ask([function, arguments, memory, seconds])
    if answer is None:
        code = os.waitstatus_to_exitcode(status)
        if code in (-signal.SIGXCPU, -signal.SIGKILL):
            raise ChildError(f"its reader is still busy with it after {seconds} s")
        name = signal.Signals(-code).name if code < 0 else f"exit status {code}"
        raise ChildError(f"its reader broke down, {name}")
    if "error" in answer:
        raise ChildError(answer["error"])
    return answer["value"]


class _Server:
    """The process that forks; started when first needed, and again after a fork of this one."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._channel: socket.socket | None = None
        self._owner = 0

    def ask(self, request: Sequence[object]) -> tuple[JsonObject | None, int]:
        """Answer, None if it is cut short, and the status with which the reading process ended."""
        with self._lock:
            channel = self._started()
            try:
                reading, writing = os.pipe()
                with open(reading, "rb") as answer:
                    try:
                        socket.send_fds(channel, [json.dumps(request).encode()], [writing])
                    finally:
                        os.close(writing)
                    found = _received(answer)
                status = channel.recv(4)
            except BaseException:
                # An answer that is still pending must not be read as the next one.
                self.stop()
                raise
            return found, int.from_bytes(status, "little")

    def _started(self) -> socket.socket:
        alive = self._process is not None and self._process.poll() is None
        if self._channel is None or self._owner != os.getpid() or not alive:
            self.stop()
            self._channel, theirs = socket.socketpair()
            with theirs:
                self._process = subprocess.Popen(
                    # -P: no modules are imported from the working folder.
                    [sys.executable, "-P", "-m", "iriftrace.core.child", str(theirs.fileno())],
                    pass_fds=[theirs.fileno()],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    # Ctrl-C is for the parent, which ends the child.
                    start_new_session=True,
                )
            self._owner = os.getpid()
        return self._channel

    def stop(self) -> None:
        """End the process and what it is reading."""
        if self._process is not None and self._owner == os.getpid():
            if self._process.poll() is None:
                os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()
        if self._channel is not None:
            self._channel.close()
        self._process = self._channel = None


_server = _Server()
atexit.register(_server.stop)


def _received(answer: BinaryIO) -> JsonObject | None:
    """What `_answer` wrote: a line of JSON, and the bytes of its arrays; None if cut short."""
    arrays: list[AnyArray] = []

    def made(values: JsonObject) -> JsonObject | AnyArray:
        if _ARRAY not in values:
            return values
        kind, shape = values[_ARRAY]
        arrays.append(np.empty(shape, dtype=kind))
        return arrays[-1]

    line = answer.readline()
    if not line.endswith(b"\n"):
        return None
    value: JsonObject = json.loads(line, object_hook=made)
    for array in filter(np.size, arrays):
        if answer.readinto(array.data.cast("B")) != array.nbytes:  # type: ignore[attr-defined]
            return None
    return value


def _answer(out: BinaryIO, work: Callable[..., object], arguments: Sequence[object]) -> None:
    arrays: list[AnyArray] = []

    def placeholder(array: AnyArray) -> JsonObject:
        arrays.append(np.ascontiguousarray(array))
        return {_ARRAY: [array.dtype.str, array.shape]}

    try:
        head = json.dumps({"value": work(*arguments)}, default=placeholder)
    except Exception as error:  # libraries that read files raise any
        arrays.clear()
        said = " ".join(str(error).split())
        head = json.dumps({"error": said or "it needs more memory than it may take"})
    out.write(head.encode() + b"\n")
    for array in filter(np.size, arrays):
        out.write(array.data)


def _limit(memory: int, seconds: int) -> None:
    """Limit this process to some address space (bytes) and processor time, and leave no core."""
    for kind, limit in (
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_CORE, 0),
    ):
        _, most = resource.getrlimit(kind)
        limit = limit if most == resource.RLIM_INFINITY else min(limit, most)
        resource.setrlimit(kind, (limit, limit))


def _serve(channel: socket.socket) -> None:
    """Fork for each request, and say how its process ended."""
    while True:
        line, descriptors, _, _ = socket.recv_fds(channel, 1 << 16, 1)
        if not line:
            return
        (function, arguments, memory, seconds), (descriptor,) = json.loads(line), descriptors
        module, _, name = function.partition(":")
        # Before the fork: libraries are imported once.
        work = getattr(import_module(module), name)
        child = os.fork()
        if child == 0:
            try:
                _limit(memory, seconds)
                with open(descriptor, "wb") as out:
                    _answer(out, work, arguments)
                # Skips the interpreter's clean-up, which would affect state of the parent.
                os._exit(0)
            finally:
                os._exit(1)
        os.close(descriptor)
        _, status = os.waitpid(child, 0)
        channel.sendall(status.to_bytes(4, "little"))


if __name__ == "__main__":
    _serve(socket.socket(fileno=int(sys.argv[1])))

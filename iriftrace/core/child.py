"""Work in a child process, for readers that trust what a file says of itself."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable


class ChildError(Exception):
    """Reason why a child process did not come to its end, as half a sentence."""


def output_of(module: str, *arguments: str) -> bytes:
    """Standard output of ``python -m module arguments``, a module that calls `run_limited`.

    ChildError if it failed, was ended by its limits or broke down.
    """
    done = subprocess.run(
        # -P: nothing of the working folder is taken for a module.
        [sys.executable, "-P", "-m", module, *arguments],
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=False,
    )
    if done.returncode < 0:
        raise ChildError(f"reading it ends with {signal.Signals(-done.returncode).name}")
    if done.returncode:
        lines = done.stderr.decode(errors="replace").split("\n")
        raise ChildError(next(filter(None, reversed(lines)), "it is unreadable"))
    return done.stdout


def limit_process(memory: int, seconds: int) -> None:
    """Limit this process to some address space (bytes) and processor time, and leave no core."""
    for kind, limit in (
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_CORE, 0),
    ):
        _, most = resource.getrlimit(kind)
        limit = limit if most == resource.RLIM_INFINITY else min(limit, most)
        resource.setrlimit(kind, (limit, limit))


def run_limited(work: Callable[[], bytes], memory: int, seconds: int) -> None:
    """Write what work returns to standard output, or its error to standard error, and end."""
    limit_process(memory, seconds)
    try:
        written = work()
    except Exception as error:  # libraries that read files let any through
        sys.stderr.write(" ".join(str(error).split()))
        os._exit(1)
    sys.stdout.buffer.write(written)
    sys.stdout.flush()
    # Closing what is damaged can hang, too.
    os._exit(0)

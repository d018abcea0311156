"""The program ``iriftrace``: options in, files and one readable summary out."""

from __future__ import annotations

import io
import signal
import sys

from iriftrace.cli.console import exit_status, ignore, noticed, raise_if_noticed, watching


def main(arguments: list[str] | None = None) -> int:
    """Run the program; returns the exit status.

    0 success, 1 a check is not passed, 2 wrong input, 130 interrupted, 143 terminated.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            # An output without a sign, such as a Windows file without "µ", shows "?" there.
            stream.reconfigure(errors="replace")
    with watching():
        status = _run(sys.argv[1:] if arguments is None else arguments)
    if arguments is None and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        # The rest is Python's own end, which would show Ctrl-C as a traceback.
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    return status


def _run(arguments: list[str]) -> int:
    try:
        # The import takes a moment, in which Ctrl-C must already be noticed.
        from iriftrace.cli.program import run

        raise_if_noticed()
        status = run(arguments)
        raise_if_noticed()
        return status
    except KeyboardInterrupt as error:
        kept = str(error)
    except BaseException:
        if not noticed():
            raise
        kept = ""
    ignore()
    print(f"interrupted; {kept or 'no incomplete file was left behind'}", file=sys.stderr)
    return exit_status()

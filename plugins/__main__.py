"""Mitsuba's command line with iriftrace's plugins: ``python -m iriftrace.plugins scene.xml``.

The command ``mitsuba`` is a program in C++, which cannot load plugins in Python. Options that this
one has are spelled and mean as there.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from iriftrace.core.errors import InputError, IriftraceError
from iriftrace.core.runtime import variant as runtime

_LEAST_THREADS = 2


def main(arguments: Sequence[str] | None = None) -> None:
    """Render scenes by their own integrators; a wrong one ends the program with status 2."""
    parser = _parser()
    given = parser.parse_args(arguments)
    if given.output is not None and len(given.scenes) > 1:
        parser.error(
            f"-o names one picture, but there are {len(given.scenes)} scenes; leave it out"
        )
    try:
        runtime.ensure(given.mode)
        for scene in given.scenes:
            _render(scene, given)
    except (IriftraceError, RuntimeError) as error:
        parser.exit(2, f"error: {runtime.readable(error)}\n")


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("python -m iriftrace.plugins", description=__doc__)
    add = parser.add_argument
    add("scenes", nargs="+", type=Path, metavar="scene.xml", help="scene files")
    add("-m", "--mode", help=f"variant, {' or '.join(runtime.VARIANTS)}")
    add("-D", "--define", action="append", default=[], metavar="KEY=VALUE", help="a parameter")
    add("-s", "--sensor", type=int, default=0, metavar="INDEX", help="sensor; default 0")
    add("-o", "--output", type=Path, help="picture; by default the scene's name with .exr")
    add("-t", "--threads", type=int, help="number of threads")
    add("-a", "--append", default="", metavar="PATH;PATH", help="more folders to look for files in")
    return parser


def _render(scene: Path, given: argparse.Namespace) -> None:
    """Render a scene, and write what its film holds."""
    import drjit as dr
    import mitsuba as mi

    if not scene.is_file():
        raise InputError(f"There is no file {scene}; check the path.", code="file.missing")
    if given.threads is not None:
        dr.set_thread_count(given.threads)
    for folder in filter(None, given.append.split(";")):
        mi.file_resolver().append(folder)  # type: ignore[operator]  # unknown to the stubs
    defined = {}
    for pair in given.define:
        key, equals, value = pair.partition("=")
        if not equals:
            raise InputError(
                f"{pair!r} defines no parameter; write key=value.", code="scene.no_value"
            )
        defined[key] = value
    loaded = mi.load_file(str(scene), optimize=False, **defined)
    sensors = loaded.sensors()
    if not 0 <= given.sensor < len(sensors):
        raise InputError(
            f"There is no sensor {given.sensor}, as {scene} has {len(sensors)}; count from 0.",
            code="scene.no_sensor",
        )
    if dr.thread_count() < _LEAST_THREADS:
        raise InputError(
            "Mitsuba hangs when it writes an EXR file with fewer than two threads; give 2 or more.",
            code="scene.few_threads",
        )
    loaded.integrator().render(loaded, sensors[given.sensor], develop=False)
    sensors[given.sensor].film().write(str(given.output or scene.with_suffix(".exr")))


if __name__ == "__main__":
    main()

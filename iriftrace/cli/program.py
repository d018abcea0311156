"""The commands of ``iriftrace`` and the handling of their errors."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from importlib.metadata import version
from itertools import takewhile
from pathlib import Path

from cyclopts import App, CycloptsError, MissingArgumentError, Parameter
from cyclopts.exceptions import UnusedCliTokensError

from iriftrace.cli.console import (
    PROJECT_FILE,
    notes,
    raise_if_noticed,
    say,
    say_finding,
    show_warning,
)
from iriftrace.core.errors import InputError, IriftraceError, IriftraceWarning

app = App(
    name="iriftrace",
    help="Traces camera rays through the hot air around a part: how far does each point move?",
    version=lambda: version("iriftrace"),
    help_format="rst",
    # No --empty-member, --empty-body ...
    default_parameter=Parameter(negative_iterable=()),
    suppress_keyboard_interrupt=False,
)


def run(arguments: list[str]) -> int:
    """Run the command that the arguments name; returns the exit status.

    0 success, 1 a check that the command made is not passed, 2 wrong input.
    """
    with warnings.catch_warnings():
        # Our warnings are messages to the user, even if Python was set to make warnings errors.
        warnings.simplefilter("default", IriftraceWarning)
        warnings.showwarning = lambda message, category, *_, **__: show_warning(
            _with_option(str(message), message, arguments), category
        )
        try:
            _import_listed(arguments)
            app.config = _defaults_here()
            arguments = _with_help(arguments)
            passed = app(
                with_negative_values(arguments),
                exit_on_error=False,
                print_error=False,
                result_action="return_value",
            )
        except (IriftraceError, CycloptsError, OSError) as error:
            return _refused(_with_option(sentence(error), error, arguments))
        except MemoryError:
            return _refused(_out_of_memory(arguments))
        except ImportError as error:
            # The loader's words where the memory does not suffice for a library.
            if "failed to map segment" not in error.msg:
                raise
            return _refused(_out_of_memory(arguments))
    return 1 if passed is False else 0


HELP, HELP_ALL = "--help", "--help-all"


def _with_help(arguments: list[str]) -> list[str]:
    """The arguments with ``--help`` for ``--help-all``, and the help laid out for which it was."""
    app.help_formatter, app.help_epilogue = None, None
    if HELP_ALL in arguments:
        return [HELP if word == HELP_ALL else word for word in arguments]
    if not {HELP, "-h"} & set(arguments):
        return arguments
    from iriftrace.cli.help_all import COMMON, CommonOptions

    name = " ".join(takewhile(lambda word: not word.startswith("-"), arguments[:2]))
    name = name if name in COMMON else "".join(arguments[:1])
    if name in COMMON:
        app.help_formatter = CommonOptions(COMMON[name])
        app.help_epilogue = f"More options: ``iriftrace {name} {HELP_ALL}``"
    return arguments


def _defaults_here() -> tuple[Callable[..., None], ...]:
    """The values of this folder's project file as defaults of the options, if there is one."""
    if not Path(PROJECT_FILE).is_file():
        return ()
    from iriftrace.cli.project_file import Defaults, read_project_file

    return (Defaults(partial(read_project_file, Path(PROJECT_FILE), app), say=say),)


def _refused(text: str) -> int:
    """Print the error that ends a command; returns its exit status."""
    raise_if_noticed()
    notes.print("[bold red]error:[/] ", end="")
    notes.print(text, markup=False, soft_wrap=True)
    return 2


_FIELD = "a field of fewer cells, a part of fewer triangles, or fewer shells (--layers)"
_PICTURE = "fewer pixels, such as -D scale=0.25"

_SMALLER = {
    "correct": "a cloud of fewer points, or the cloud in pieces",
    "scene": _FIELD,
    "shells": _FIELD,
    "field": "fewer or larger cells",
    "part": "a part of fewer triangles",
    "render": _PICTURE,
    "measure": _PICTURE,
    "photograph": _PICTURE,
    "sweep": _PICTURE,
}
"""Inputs that need the memory of a command, in a size that may fit."""


def _out_of_memory(arguments: list[str]) -> str:
    """The error of a command for which the memory does not suffice."""
    smaller = _SMALLER.get("".join(arguments[:1]), "smaller inputs")
    return f"This needs more memory than the machine has; give it {smaller}."


def _called(arguments: list[str]) -> App:
    """The command, or group of commands, that the arguments name."""
    called = app
    for word in arguments:
        if word.startswith("-") or word not in called:
            break
        called = called[word]
    return called


def _import_listed(arguments: list[str]) -> None:
    """Import the commands below the one that is called, whose docstrings are listed in the help."""
    called = _called(arguments)
    for name in called:
        called[name]


_ARGUMENT = re.compile(r"`([a-z][a-z0-9_]*)`")
"""Names of arguments in the sentences of the library."""


def _with_option(text: str, fault: object, arguments: list[str]) -> str:
    """A message with options in place of the arguments that it names.

    The option of the fault's `argument`, or that of `scene` where the command has none, is added
    if it is not among them.
    """
    while isinstance(fault, CycloptsError) and fault.__cause__ is not None:
        fault = fault.__cause__
    command = _called(arguments)
    if command.default_command is None:  # a group has no options
        return text
    known = _options(command)

    def shown(match: re.Match[str]) -> str:
        option = _option(match[1])
        return option if option in known else match[0]

    text = _ARGUMENT.sub(shown, text)
    name = getattr(fault, "argument", None)
    if not isinstance(name, str) or _option(name) in text:
        return text
    if _option(name) in known:
        return f"{text.removesuffix('.')} ({_option(name)})."
    if _option(name) in _options(app["scene"]):
        return f"{text.removesuffix('.')} ({_option(name)} of iriftrace scene)."
    return text


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def _options(command: App) -> set[str]:
    return {name for one in command.assemble_argument_collection() for name in one.names}


# No option of the program begins with a digit.
_NEGATIVE = re.compile(r"-\.?\d")


def with_negative_values(words: Sequence[str]) -> list[str]:
    """The command line with options joined to negative values: ``--ambient=-10 degC``.

    Cyclopts reads -10 as a number, but -10 degC and -50,-100,120 as options.
    """
    joined: list[str] = []
    for word in words:
        takes = bool(joined) and joined[-1].startswith("--") and "=" not in joined[-1]
        if takes and _NEGATIVE.match(word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def sentence(error: Exception) -> str:
    """An error as the program shows it: on one line, from a capital letter to a full stop."""
    if isinstance(error, CycloptsError) and isinstance(error.__cause__, InputError):
        # One of our converters has a better message.
        error = error.__cause__
    if isinstance(error, CycloptsError):
        return _of_the_command_line(error)
    if isinstance(error, OSError):
        return f"Cannot read or write {error.filename or 'a file'}: {error.strerror}."
    text = " ".join(str(error).split())
    first = re.match(r"([a-z]+) (?!- )", text)
    # A file's name or a symbol such as n at the beginning keeps its own spelling.
    if first and not Path(first[1]).exists():
        text = text[0].upper() + text[1:]
    return text if text.endswith((".", "!", "?")) else text + "."


def _of_the_command_line(error: CycloptsError) -> str:
    command = " ".join(("iriftrace", *(error.command_chain or ())))
    text = " ".join(str(error).split())
    if isinstance(error, UnusedCliTokensError):
        text = f"Unexpected arguments: {' '.join(error.unused_tokens or ())}."
    elif isinstance(error, MissingArgumentError) and error.argument and error.keyword is None:
        name = error.argument.names[0]
        positional = error.argument.index is not None
        text = f"`{command}` needs {name.removeprefix('--').upper() if positional else name}."
    elif isinstance(error, MissingArgumentError) and error.argument:
        name, count = error.argument.names[0], error.argument.token_count()[0]
        if count > 1:
            text = f"{name} takes {count} values, not {len(error.tokens_so_far) % count}."
    return f"{text} See `{command} --help`."


@app.command
def doctor() -> None:
    """Check this machine: versions, variants, the LLVM or CUDA library, and how to repair them.

    Example: ``iriftrace doctor``
    """
    from iriftrace.core.runtime.doctor import diagnose

    diagnosis = diagnose()
    for finding in diagnosis.findings:
        say_finding(finding.state, finding.name, finding.text)
        if finding.remedy:
            say(f"      {finding.remedy}")
    if not diagnosis.ok:
        raise InputError(
            "Something that iriftrace needs is missing; see the lines marked error.",
            code="machine.incomplete",
        )


# By name, so that the program starts fast: a module is imported when its command is called or
# listed.
for _module, _names in {
    "project.commands": ("new", "run", "status"),
    "cli.scene": ("shells", "scene"),
    "cli.render": ("render", "metrics", "demo"),
    "cli.sweep": ("sweep",),
    "cli.plan": ("plan",),
    "cli.plot": ("plot", "view", "report"),
    "cli.measure": ("measure",),
    "cli.photograph": ("photograph",),
    "cli.correct": ("correct",),
    "cli.budget": ("budget",),
    "cli.sensitivity": ("sensitivity",),
    "cli.twin": ("twin",),
    "cli.qualify": ("qualify",),
    "cli.ray": ("ray",),
    "cli.compare": ("compare",),
    "cli.board": ("board",),
    "cli.fit": ("fit",),
    "cli.field": ("field",),
    "cli.part": ("part",),
}.items():
    for _name in _names:
        app.command(f"iriftrace.{_module}:{_name}", name=_name)

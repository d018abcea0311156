"""Commands that are imported when they are called, so that the program starts at once."""

from __future__ import annotations

from cyclopts import App


def add_command(app: App, program: str, module: str, name: str, what: str, arguments: str) -> None:
    """Register a command by name.

    Parameters
    ----------
    app
        Gets the command.
    program
        What a user types before the command's name, for the example.
    module, name
        Module in ``iriftrace.cli``; function in it and command.
    what
        What it does, one sentence.
    arguments
        An example of what is typed after the name.
    """
    example = " ".join((program, name, arguments)).rstrip()
    app.command(
        f"iriftrace.cli.{module}:{name}",
        name=name,
        help=f"{what}\n\nExample: ``{example}``",
    )

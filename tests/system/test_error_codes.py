"""Every error has a code that docs/errors.md lists; options are named by the command line alone."""

import ast
import pickle
import re
from pathlib import Path

import pytest

from iriftrace.core.errors import InputError
from validation import errors

OPTION = re.compile(r"(?<![\w-])--[a-z]")
OF_OTHER_PROGRAMS = {
    "iriftrace/flow/simulate/programs.py": {"--pdeathsig", "--oversubscribe"},
}
"""Arguments of programs that a file calls."""

FILES = {str(file.relative_to(errors.ROOT)): file for file in errors.sources()}


@pytest.mark.parametrize("name", FILES)
def test_every_error_has_a_code(name: str) -> None:
    without = [
        one.line
        for one in errors.raised(FILES[name])
        if not one.stated or (one.code is not None and not errors.SHAPE.fullmatch(one.code))
    ]
    assert without == [], f"lines of {name}"


ABOVE = ("iriftrace/cli/", "iriftrace/project/", "plugins/__main__.py")
"""Rooms of commands, and the one command outside of them."""


@pytest.mark.parametrize("name", [name for name in FILES if not name.startswith(ABOVE)])
def test_options_are_named_by_the_command_line_alone(name: str) -> None:
    found = [
        f"{node.lineno}: {node.value.strip()[:60]}"
        for node in ast.walk(ast.parse(FILES[name].read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant)
        and isinstance(node.value, str)
        and node.value not in OF_OTHER_PROGRAMS.get(name, ())
        and OPTION.search(node.value)
    ]
    assert found == []


def test_the_page_lists_the_codes_of_the_sources() -> None:
    assert errors.PAGE.read_text(encoding="utf-8") == errors.page(), (
        "write it again: python -m validation.errors"
    )


def test_an_error_keeps_its_code_between_processes() -> None:
    error = pickle.loads(pickle.dumps(InputError("No part.", code="part.none", argument="part")))
    assert (str(error), error.code, error.argument) == ("No part.", "part.none", "part")
    assert isinstance(error, InputError)


def test_sources_are_found() -> None:
    assert {Path(name).parts[0] for name in FILES} == {"iriftrace", "plugins"}

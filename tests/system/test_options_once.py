"""An option's default stands once: in the class or function of the library that has it."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import iriftrace

PACKAGE = Path(iriftrace.__file__).parent
COMMANDS = sorted((PACKAGE / "cli").glob("*.py"))
UNIT = re.compile(r"_(nm|mm|k|pa|deg|ppm)$")


def defaults(path: Path) -> Iterator[tuple[str, str]]:
    """Names without units, of arguments and fields, and the number or word that they default to.

    Those that are read from elsewhere do not count, nor switches and what is nothing.
    """
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        pairs: list[tuple[str, ast.expr | None]] = []
        if isinstance(node, ast.FunctionDef):
            of_all = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
            values = [*node.args.defaults, *node.args.kw_defaults]
            last = of_all[len(of_all) - len(values) :]
            pairs = [(one.arg, value) for one, value in zip(last, values, strict=True)]
        elif isinstance(node, ast.ClassDef):
            fields = [one for one in node.body if isinstance(one, ast.AnnAssign)]
            pairs = [(ast.unparse(one.target), one.value) for one in fields]
        for name, value in pairs:
            while isinstance(value, ast.Call):  # field(default=Length(35.0))
                given = [one.value for one in value.keywords if one.arg == "default"]
                value = next(iter([*given, *value.args]), None)
            try:
                found = None if value is None else ast.literal_eval(value)
            except ValueError:
                continue
            if found and not isinstance(found, bool):
                yield UNIT.sub("", name), repr(found)


@cache
def of_the_library() -> set[tuple[str, str]]:
    library = [file for file in PACKAGE.rglob("*.py") if file.parent.name != "cli"]
    return {default for file in library for default in defaults(file)}


@pytest.mark.parametrize("path", COMMANDS, ids=lambda path: path.name)
def test_no_default_is_stated_twice(path: Path) -> None:
    assert [default for default in defaults(path) if default in of_the_library()] == []

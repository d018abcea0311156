"""Every command lists at most twenty inputs and options, and all of them on request."""

import re
from collections.abc import Iterator

import pytest
from cyclopts import App

from iriftrace.cli import main
from iriftrace.cli.help_all import COMMON, MOST
from iriftrace.cli.program import app


def commands(group: App, *words: str) -> Iterator[tuple[str, set[str]]]:
    """Each command below a group, and the names of its inputs and options."""
    for name in group:
        if name.startswith("-"):
            continue
        if group[name].default_command is None:
            yield from commands(group[name], *words, name)
            continue
        shown = [
            one
            for one in group[name].assemble_argument_collection()
            if not one.children and one.parse and one.show
        ]
        names = [next((n for n in one.names if n.startswith("--")), one.names[0]) for one in shown]
        yield " ".join((*words, name)), {one.lstrip("-").lower() for one in names}


def listed(text: str) -> set[str]:
    """Options with which a line of the help begins."""
    return set(re.findall(r"^\W*(?:[A-Z]+ )?--([a-z0-9-]+)", text, re.MULTILINE))


def test_a_command_with_many_options_has_a_list_of_common_ones() -> None:
    found = dict(commands(app))
    assert {name for name, options in found.items() if len(options) > MOST} == COMMON.keys()
    for name, common in COMMON.items():
        assert len(common) <= MOST
        assert common <= found[name], name


def test_the_help_lists_common_options_and_names_the_other_list(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["scene", "--help"]) == 0
    said = capsys.readouterr().out
    assert "iriftrace scene --help-all" in said
    assert "co2" not in said
    assert listed(said) <= COMMON["scene"]
    assert main(["scene", "--help-all"]) == 0
    everything = capsys.readouterr().out
    assert {"co2", "rule", "distortion", *COMMON["scene"]} <= listed(everything) | {"output"}
    assert main(["measure", "--help"]) == 0
    assert "help-all" not in capsys.readouterr().out
    assert main(["field", "simulate", "--help"]) == 0
    assert "--wall-above" not in capsys.readouterr().out

"""A project's file, iriftrace.toml: its keys checked, and its values as defaults of commands."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Collection, Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from attrs import Factory, evolve, frozen
from cyclopts import App, CycloptsError, Token
from cyclopts.argument import Argument, ArgumentCollection

from iriftrace.cli.sections import COMMANDS, FEATURE_KEYS, SECTIONS, keyed
from iriftrace.core.errors import InputError
from iriftrace.core.files import text_in
from iriftrace.measuring.uncertainty.inputs import NAMES
from iriftrace.measuring.uncertainty.options import AnswerOptions

PLANNED = "plan"
"""Value of [camera] pose for the best pose of a sweep."""

NO_VERDICT = ("feature.tolerance",)
"""Keys without which there is no verdict."""

Values = Mapping[str, Any]


@frozen
class ProjectFile:
    """Values of a project's file.

    Attributes
    ----------
    path : Path
    sections : mapping
        Values by section and key, as the file has them.
    features : tuple of mapping
        Each ``[[feature]]``.
    uncertainty : mapping
        Texts by the name of the input.
    example : tuple of str
        Sections, and keys such as "part.hot_temperature", whose values are examples.
    options : mapping
        Section and key of the options of each command that the file has.
    """

    path: Path
    sections: Mapping[str, Values]
    features: tuple[Values, ...] = ()
    uncertainty: Values = Factory(dict)
    example: tuple[str, ...] = ()
    options: Mapping[str, tuple[tuple[str, str], ...]] = Factory(dict)

    def get(self, section: str, key: str) -> Any:
        """Value of a key; None if the file does not have it."""
        return self.sections.get(section, {}).get(key)

    def texts(self, section: str, key: str, argument: Argument | None = None) -> list[str]:
        """A value as words of the command line; empty if the file does not have it."""
        if section == "feature":
            return [text for one in self.features for text in _feature(one, key)]
        if section == "uncertainty":
            stated = ", ".join(f"{name} {value}" for name, value in self.uncertainty.items())
            return [stated] if stated else []
        value = self.get(section, key)
        if value is None:
            return []
        listed = _words(value)
        several = argument is None or argument.token_count()[1]
        return listed if several else [",".join(listed)]

    def fault(self, text: str, section: str, key: str = "", *, code: str) -> InputError:
        """The error of a key, whose sentence follows file and key."""
        where = f"[{section}] {key}".rstrip()
        return InputError(f"{self.path}, {where}: {text}", code=code)


def _feature(values: Values, key: str) -> list[str]:
    kind, region = values.get("kind", "cylinder"), values.get("region")
    name = kind if region is None else f"{kind}:{region}"
    if key == "feature":
        return [name]
    if "tolerance" not in values:
        return []
    number, _, unit = str(values["nominal"]).partition(" ")
    limits = str(values["tolerance"]).removesuffix(unit).strip()
    return [f"{name}={number} {limits} {unit}"]


def _words(value: object) -> list[str]:
    if isinstance(value, list):
        return [text for one in value for text in _words(one)]
    return [str(value).lower() if isinstance(value, bool) else str(value)]


def read_project_file(path: Path, app: App) -> ProjectFile:
    """Read a project's file, and check keys and values on the options of the program `app`.

    Raises InputError, one sentence with file and key, for what is not TOML, an unknown key, a value
    that its option cannot have, and values that contradict each other.
    """
    try:
        content = tomllib.loads(text_in(path))
    except FileNotFoundError:
        raise InputError(
            f"There is no {path}; write one with `iriftrace new`, or change to its folder.",
            code="project.missing",
        ) from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(
            f"{path} cannot be read as TOML: {error}; quote texts, and write each key once.",
            code="project.no_toml",
        ) from error
    sections = {name: value for name, value in content.items() if name in SECTIONS}
    for outer in [name for name in SECTIONS if "." in name]:
        name, _, inner = outer.partition(".")
        if isinstance(sections.get(name), dict) and inner in sections[name]:
            sections[name] = dict(sections[name])
            sections[outer] = sections[name].pop(inner)
    features, uncertainty = content.get("feature", []), content.get("uncertainty", {})
    example = content.get("example", [])
    file = ProjectFile(path, sections, tuple(features), uncertainty, tuple(example))
    known = (*SECTIONS, "feature", "uncertainty", "example")
    _refuse_unknown(file, content, known, "")
    for name, values in (*sections.items(), ("uncertainty", uncertainty)):
        if not isinstance(values, dict):
            raise file.fault(
                "this is a section, not a value; write its keys below it.",
                name,
                code="project.no_section",
            )
    _check_answers(file)
    _check_air(file)
    _check_plan(file)
    return evolve(file, options=_check_options(file, app))


def _refuse_unknown(
    file: ProjectFile, keys: Iterable[str], known: Collection[str], of: str
) -> None:
    for key in keys:
        if key in known:
            continue
        near = get_close_matches(key, known, 1, 0.5)
        remedy = f"did you mean {near[0]}?" if near else f"the keys are {', '.join(sorted(known))}."
        where = f"[{of}]" if of else "it"
        raise InputError(
            f"{file.path}: {where} has no key {key}; {remedy}", code="project.unknown_key"
        )


def _check_answers(file: ProjectFile) -> None:
    """Check features, and the names of uncertainties and examples."""
    for feature in file.features:
        _refuse_unknown(file, feature, FEATURE_KEYS, "feature")
        if ("nominal" in feature) != ("tolerance" in feature):
            raise file.fault(
                'a tolerance needs both, such as nominal = "20.22 mm" and tolerance = "-0.02 0.02 '
                'mm".',
                "feature",
                "nominal" if "tolerance" in feature else "tolerance",
                code="project.half_tolerance",
            )
    _refuse_unknown(file, file.uncertainty, NAMES, "uncertainty")
    stated = AnswerOptions(
        " ".join(file.texts("uncertainty", "")), file.texts("feature", "tolerance")
    )
    for section in ("uncertainty", "feature"):
        try:
            _ = stated.inputs if section == "uncertainty" else stated.tolerances
        except InputError as error:
            raise file.fault(str(error), section, code=error.code) from None
    for name in file.example:
        section, _, key = name.rpartition(".")
        there = name in file.sections or file.get(section, key) is not None
        if not there and name not in ("feature", "uncertainty", "air"):
            raise InputError(
                f"{file.path}: example names {name}, which the file does not have; remove it.",
                code="project.no_example",
            )


def _check_air(file: ProjectFile) -> None:
    """Check that the air has one source."""
    named = [f"[{name}]" for name in ("air.simulate", "air.synthetic") if name in file.sections]
    if file.get("air", "fields") is not None:
        named.insert(0, "fields")
    if len(named) > 1:
        raise file.fault(
            f"{' and '.join(named)} are given, but the air has one source; remove the other.",
            "air",
            code="project.two_airs",
        )


def _check_plan(file: ProjectFile) -> None:
    """Check that the scene of a planned pose has the lens of the sweep that ranked it."""
    planned = file.get("camera", "pose") == PLANNED
    swept = file.get("sweep", "focal_length")
    if planned and swept not in (None, file.get("camera", "focal_length")):
        raise file.fault(
            "the best pose would be for this focal length, but the scene has that of [camera]; "
            "write it there.",
            *("sweep", "focal_length"),
            code="project.other_lens",
        )


def _check_options(file: ProjectFile, app: App) -> dict[str, tuple[tuple[str, str], ...]]:
    """Check the keys of all sections, their values, and that those of a class go together.

    Returns section and key of the options of each command that the file has.
    """
    found: dict[str, tuple[tuple[str, str], ...]] = {}
    known = {name: set(section.own) for name, section in SECTIONS.items()}
    for command in COMMANDS:
        called = app
        for word in command.split():
            called = called[word]
        arguments = called.assemble_argument_collection()
        groups: dict[int, tuple[str, Argument]] = {}
        for section, key, argument, group in keyed(command, arguments):
            known.setdefault(section, set()).add(key)
            if not _fill(file, section, key, argument):
                continue
            count, several = argument.token_count()
            if several and len(argument.tokens) % count:
                raise file.fault(
                    f"a list of {len(argument.tokens)} is given, but {count} belong together; "
                    f"write lists of {count}.",
                    *(section, key),
                    code="project.value_count",
                )
            _convert(file, section, key, argument)
            found[command] = (*found.get(command, ()), (section, key))
            if group is not None:
                groups[id(group)] = section, group
        for section, group in groups.values():
            _convert(file, section, "", group)
    for name, values in file.sections.items():
        _refuse_unknown(file, values, known[name], name)
    return found


def _fill(file: ProjectFile, section: str, key: str, argument: Argument) -> bool:
    """Give an option the value of the file; False if there is none."""
    texts = file.texts(section, key, argument)
    for number, text in enumerate(texts):
        argument.append(Token(keyword=key, value=text, source=str(file.path), index=number))
    return bool(texts)


def _convert(file: ProjectFile, section: str, key: str, argument: Argument) -> None:
    try:
        argument.convert_and_validate()
    except (InputError, CycloptsError) as error:
        fault: BaseException = error
        if isinstance(error, CycloptsError):
            error.verbose = False  # else its text begins with the name of its class
        if isinstance(error, CycloptsError) and isinstance(error.__cause__, ValueError):
            fault = error.__cause__
        named = key or str(getattr(fault, "argument", None) or "")
        code = fault.code if isinstance(fault, InputError) else "project.wrong_value"
        text = " ".join(str(fault).replace("`", "").split()).replace(f" from {file.path}", "")
        raise file.fault(text, section, named, code=code) from None


def is_among(section: str, key: str, listed: Collection[str]) -> bool:
    """True if a list of sections and keys, such as "feature.tolerance", has a key."""
    return section in listed or f"{section}.{key}" in listed


class Defaults:
    """The values of a project's file as defaults of the options of a program's commands.

    A file with examples gives no tolerances, so that nothing is decided by them.

    Parameters
    ----------
    read
        Reads the file, if a command has options in it.
    without
        Sections, and keys such as "feature.tolerance", that are not used.
    say
        Called with a line about the keys whose values are used.
    """

    def __init__(
        self,
        read: Callable[[], ProjectFile],
        without: Collection[str] = (),
        say: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.read, self.without, self.say = read, without, say

    def __call__(self, app: App, commands: tuple[str, ...], arguments: ArgumentCollection) -> None:
        """Fill the options that the command line does not give."""
        options = list(keyed(" ".join(commands), arguments))
        if not options:
            return
        file, used = self.read(), dict[str, list[str]]()
        without = (*self.without, *(NO_VERDICT if file.example else ()))
        for section, key, argument, _ in options:
            planned = (section, key) == ("camera", "pose") and file.get(section, key) == PLANNED
            left_out = planned or is_among(section, key, without)
            if not left_out and not argument.tokens and _fill(file, section, key, argument):
                used.setdefault(section, []).append(key)
        if used:
            listed = (f"[{section}] {', '.join(keys)}" for section, keys in used.items())
            self.say(f"From {file.path}: {'; '.join(listed)}.")

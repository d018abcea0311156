"""Files of a release that repeat what pyproject.toml says."""

import json
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

CHECKOUT = Path(__file__).parents[2]
PROJECT = tomllib.loads((CHECKOUT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CONDA_NAMES = {"openexr": "openexr-python", "matplotlib": "matplotlib-base"}


def read(name: str) -> str:
    return (CHECKOUT / name).read_text(encoding="utf-8")


def required(lines: list[str]) -> set[tuple[str, str]]:
    """Names on conda-forge and bounds of requirements."""
    found = [Requirement(line) for line in lines]
    return {
        (CONDA_NAMES.get(entry.name.lower(), entry.name.lower()), str(entry.specifier))
        for entry in found
    }


def test_every_file_has_the_version_of_the_package() -> None:
    version = PROJECT["version"]
    recipe = yaml.safe_load(read("conda/recipe.yaml"))
    assert recipe["context"]["version"] == version
    assert yaml.safe_load(read("CITATION.cff"))["version"] == version
    assert f"## {version}," in read("CHANGELOG.md")


def test_the_conda_recipe_requires_what_the_wheel_requires() -> None:
    recipe = yaml.safe_load(read("conda/recipe.yaml"))
    python = ("python", PROJECT["requires-python"])
    expected = required(PROJECT["dependencies"]) | {python}
    assert required(recipe["requirements"]["run"]) == expected
    entry_points = {f"{name} = {place}" for name, place in PROJECT["scripts"].items()}
    assert set(recipe["build"]["python"]["entry_points"]) == entry_points


def test_citation_and_archive_name_one_work() -> None:
    citation, archive = yaml.safe_load(read("CITATION.cff")), json.loads(read(".zenodo.json"))
    assert archive["title"] == citation["title"]
    assert archive["license"] == citation["license"] == PROJECT["license"]
    assert archive["related_identifiers"][0]["identifier"] == citation["references"][0]["doi"]


@pytest.mark.parametrize("job", ["test", "installed"])
def test_the_workflow_covers_the_systems_and_pythons(job: str) -> None:
    jobs = yaml.safe_load(read(".github/workflows/ci.yml"))["jobs"]
    matrix = jobs[job]["strategy"]["matrix"]
    assert {name.split("-")[0] for name in matrix["system"]} == {"ubuntu", "macos", "windows"}
    assert f">={matrix['python'][0]}" == PROJECT["requires-python"]
    assert matrix["python"] == ["3.11", "3.12", "3.13", "3.14"]


def test_nothing_is_uploaded_until_a_person_enables_it() -> None:
    jobs = yaml.safe_load(read(".github/workflows/ci.yml"))["jobs"]
    uploads = [name for name, job in jobs.items() if "pypi-publish" in json.dumps(job)]
    assert uploads == ["publish"]
    assert "vars.PUBLISH == 'true'" in jobs["publish"]["if"]
    assert set(jobs["publish"]["needs"]) == set(jobs) - {"publish", "paper"}

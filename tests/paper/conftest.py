"""Fixtures of the tests of the paper's studies: the files of the hot block."""

from pathlib import Path

import pytest

from validation.inputs import hot_block


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Its field and its part."""
    return hot_block.save(tmp_path_factory.mktemp("hot"))

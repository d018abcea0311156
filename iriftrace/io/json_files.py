"""Read JSON files whose content is the value of a class."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TypeVar

from iriftrace.core.errors import InputError
from iriftrace.core.files import text_in
from iriftrace.core.plain import structured
from iriftrace.io.refusals import check_exists, check_schema, damaged

T = TypeVar("T")


def read_json(path: Path, kind: type[T], schema: str, remedy: str) -> T:
    """The value of a class in a file; InputError if missing, damaged or of another schema."""
    check_exists(path, remedy)
    try:
        values = json.loads(text_in(path))
        stated = values.get("schema") if isinstance(values, dict) else None
        check_schema(path, stated, schema, remedy)
        return structured(values, kind)
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise damaged(path, error, remedy) from error

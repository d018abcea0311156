"""Files of lost rays (.rays.json), next to the result that lost them."""

from __future__ import annotations

import json
import math
from pathlib import Path

from iriftrace.core.errors import InputError
from iriftrace.core.files import write_json
from iriftrace.core.plain import plain, structured
from iriftrace.image.aov_image import Status
from iriftrace.image.lost_rays import SCHEMA, LostRays
from iriftrace.io.refusals import check_exists

SUFFIX = ".rays.json"


def rays_file_of(result: Path) -> Path:
    """Name of the file for a result."""
    return result.with_suffix(SUFFIX)


def write_lost_rays(path: str | Path, rays: LostRays) -> None:
    """Write rays; numbers have all digits of double precision."""
    write_json(path, plain(rays))


def read_lost_rays(path: str | Path) -> LostRays:
    """Read the rays that a rendering or a measurement lost; InputError if the file holds none."""
    check_exists(Path(path))
    try:
        found = structured(json.loads(Path(path).read_text(encoding="utf-8")), LostRays)
        if found.schema != SCHEMA:
            raise ValueError(f"its schema is {found.schema!r} instead of {SCHEMA!r}")
        for ray in found.rays:
            vectors = (*ray.origin_mm, *ray.direction)
            if not (all(map(math.isfinite, vectors)) and math.hypot(*ray.direction) > 0.0):
                raise ValueError(f"ray {ray.number} has no direction or is not finite")
            if ray.status not in list(Status):
                raise ValueError(f"{ray.status} is not a ray's status")
    except (ValueError, RecursionError) as error:
        raise InputError(
            f"{path} is not a file of lost rays ({error}); give the file ending in {SUFFIX} that "
            "render or measure wrote.",
            code="rays.no_file",
        ) from error
    return found

"""The sections of the page, in its order."""

from __future__ import annotations

from validation.sections import (
    agreement,
    air_effects,
    column,
    exact_continuous,
    exact_shells,
    fields,
    index_steps,
    ledger,
    naive,
    noise_floor,
    readers,
    resolutions,
    trouble,
)

SECTIONS = tuple(
    module.SECTION
    for module in (
        exact_shells,
        exact_continuous,
        index_steps,
        noise_floor,
        agreement,
        fields,
        resolutions,
        column,
        readers,
        trouble,
        ledger,
        air_effects,
        naive,
    )
)

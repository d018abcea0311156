"""The sections of the page: what is known exactly before what only agrees."""

from validation.sections import (
    air_effects,
    column,
    exact_cells,
    exact_shells,
    index_steps,
    known_air,
    ledger,
    naive,
    noise_floor,
    other_air,
    readers,
    trouble,
    two_devices,
    two_engines,
)

SECTIONS = tuple(
    module.SECTION
    for module in (
        exact_shells,
        exact_cells,
        two_devices,
        other_air,
        known_air,
        column,
        noise_floor,
        index_steps,
        two_engines,
        trouble,
        readers,
        air_effects,
        ledger,
        naive,
    )
)

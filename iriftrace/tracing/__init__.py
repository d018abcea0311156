"""Scenes in memory and on disk, and the rays through them.

A `Scene` and rays or a camera go in, hits with a status come out. Mitsuba is imported here, in
`plugins` and in `core.runtime` alone.
"""

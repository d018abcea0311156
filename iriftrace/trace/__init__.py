"""Tracing: a loaded scene's picture from any pose, and free bundles of rays through it.

Each result states where it comes from and how far its shells can be relied on.
"""

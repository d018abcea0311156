"""Tracing: a loaded scene's picture from any pose, and free bundles of rays through it.

With where each result comes from, and how far its shells can be relied on.
"""

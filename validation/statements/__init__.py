"""Statements of the paper on the components, checked here: ``docs/parts.md``."""

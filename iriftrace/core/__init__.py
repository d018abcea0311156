"""Errors, units, array types and files written whole: needed by every room."""

"""Writes fields as other programs write them, for tests and figures about the readers."""

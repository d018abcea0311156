"""Answers that are computed without the tracer."""

"""Accuracy of the tracer, as a page that is computed again: ``python -m validation``."""

"""Compute the page on the accuracy of the tracer: ``python -m validation``."""

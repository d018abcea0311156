"""Scene folders written, read and loaded."""

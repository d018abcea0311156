"""Fields written in the formats of other programs, to test the readers."""

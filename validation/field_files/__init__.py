"""Fields written as other programs write them, for checks of the readers."""

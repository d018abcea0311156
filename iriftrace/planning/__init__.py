"""Which poses are best, and how sure that is."""

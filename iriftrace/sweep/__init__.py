"""Many poses in one result."""

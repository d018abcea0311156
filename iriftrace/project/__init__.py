"""Projects: one file of declarations, and the steps that make what is missing or has changed."""

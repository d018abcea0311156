"""What the paper says of the components, and whether it holds here: ``docs/parts.md``."""

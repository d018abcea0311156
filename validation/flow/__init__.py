"""Is the flow right? Engine and simulations against solutions of the flow: docs/validation.md."""

"""Quality of a temperature field."""

"""Speed as ratios within one run, because absolute times vary: ``python -m bench``."""

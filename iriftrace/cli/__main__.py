"""``python -m iriftrace.cli``."""

import sys

from iriftrace.cli import main

sys.exit(main())

"""``python -m iriftrace``: the program."""

from __future__ import annotations

import sys

from iriftrace.cli import main

sys.exit(main())

"""``python -m symgrasp``: the command line."""

import sys

from symgrasp.cli import main

sys.exit(main())

"""``python -m symgrasp``: the command line."""

import sys

from symgrasp.cli.main import main

sys.exit(main())

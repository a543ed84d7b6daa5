"""``python -m app …``: the same as ``symgrasp app …``."""

import sys

from symgrasp.cli.main import main

sys.exit(main(["app", *sys.argv[1:]]))

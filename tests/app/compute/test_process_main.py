"""What the process that computes has to import."""

from __future__ import annotations

import subprocess
import sys


def test_state_and_computing_know_no_browser():
    pure = "app.state.state, app.compute.process_main, app.html.map, app.render.map_picture"
    code = f"import sys, {pure}; sys.exit('viser' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0

"""Starting the page from the command line, and what keeps it from starting."""

from __future__ import annotations

import signal
import socket
import subprocess
import sys
from functools import partial

import pytest

from app.server.door.viser_server import any_port
from app.server.serve import serve
from symgrasp.errors import InputError
from tests.app.wire import Wire


def test_a_busy_port_is_an_error_that_names_it():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"--port: {port}: expected a free port"):
            serve("bottle_on_table", "127.0.0.1", port)


@pytest.mark.parametrize("port", [0, -1, 65536])
def test_a_port_that_is_none_is_an_error(port):
    with pytest.raises(InputError, match="a port from 1 to 65535"):
        serve("bottle_on_table", "127.0.0.1", port)


def test_a_server_for_nobody_is_an_error():
    with pytest.raises(InputError, match="--max-sessions: 0: expected a whole number of at least 1"):
        serve("bottle_on_table", "127.0.0.1", any_port(), max_sessions=0)


def test_an_unknown_host_is_an_error():
    with pytest.raises(InputError, match="--host"):
        serve("bottle_on_table", "no.such.host.invalid", 8080)


def test_an_unknown_scene_ends_the_command_with_one_line():
    done = subprocess.run(
        [sys.executable, "-m", "app", "no_scene", "--port", str(any_port())],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert done.stdout == ""
    (line,) = done.stderr.splitlines()
    assert "no_scene" in line
    assert "bottle_on_table" in line


@pytest.mark.parametrize("what", ["idle", "computing", "not reading"])
def test_ctrl_c_with_browsers_connected_is_quiet(what):
    port = any_port()
    command = [sys.executable, "-m", "app", "soda_can", "--port", str(port)]
    heed = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    pipe = subprocess.PIPE
    server = subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, preexec_fn=heed)
    try:
        assert server.stdout
        server.stdout.readline()
        with Wire(port) as one, Wire(port) as other:
            one.wait_for("Ready.")
            other.wait_for("Ready.")
            if what == "computing":
                one.trigger("Plan one grasp for all tasks")
                other.trigger("Save the 3D view (HTML)")
            elif what == "not reading":
                for k in range(30):
                    one.set("x (cm)", 50 + 0.1 * k)
            server.send_signal(signal.SIGINT)
            out, errors = server.communicate(timeout=60)
        assert (server.returncode, out, errors) == (0, "\nsymgrasp: stopped\n", "")
    finally:
        server.kill()

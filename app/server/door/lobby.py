"""The sessions of a server: one for each browser that has loaded the page at the front door."""

from __future__ import annotations

import asyncio
import logging
import secrets
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from html import escape
from pathlib import Path

import viser
from websockets.protocol import State

from ...compute.cache import SharedCache
from ...compute.process_pool import ProcessPool
from ...files.shown_paths import shown_paths
from ..kept_pages.left_pages import LeftPage, LeftPages
from ..kept_pages.stored_pages import StoredFiles, StoredPages
from ..session.session import Session
from .browser_connection import BrowserConnection, current_connection
from .front_door import HELLO, FrontDoor, Visit
from .viser_server import quiet_server

__all__ = ["Lobby", "open_lobby"]

log = logging.getLogger(__name__)

STYLE = "font:13px/1.5 system-ui,sans-serif;margin:12px"


@contextmanager
def open_lobby(
    cache: SharedCache,
    host: str,
    port: int,
    max_sessions: int = 16,
    folder: Path | None = None,
    key: str = "",
) -> Iterator[Lobby]:
    """Serve the page on a port while the ``with`` block runs.

    Args:
        cache: what all sessions share.
        host, port: the address to listen on.
        max_sessions: how many browsers may use it at the same time.
        folder: where what pages show is stored for later servers; nowhere if None.
        key: see `FrontDoor`.

    Raises:
        OSError: the port cannot be listened on.
    """
    with closing(Lobby(cache, folder)) as lobby:
        server = quiet_server(FrontDoor(host, port, lobby.visited, max_sessions, lobby.show_map, key))
        server.on_client_connect(lobby.connected)
        server.on_client_disconnect(lobby.disconnected)
        try:
            yield lobby
        finally:
            lobby.close()
            server.stop()


class Lobby:
    """Opens and closes the sessions of a server; its methods may be called from any thread.

    Args:
        cache: what all sessions share.
        folder: see `open_lobby`.
    """

    def __init__(self, cache: SharedCache, folder: Path | None = None) -> None:
        self._cache = cache
        self._pool = ProcessPool(cache.folders)
        self._lock = threading.Condition()
        self._waiting: dict[str, _Waiting] = {}
        self._sessions: dict[int, Session] = {}
        self._pages: dict[str, Session] = {}
        self._opened = asyncio.Event()
        self._left = LeftPages()
        self._stored = StoredPages(folder, self._shown) if folder else None
        self._closed = False
        threading.Thread(target=self._pool.prepare, daemon=True).start()

    def wait_until_empty(self, timeout: float | None = None) -> bool:
        """Wait, for so long (s) at most, until there is no session; return whether there is none."""
        with self._lock:
            return self._lock.wait_for(lambda: not self._sessions, timeout)

    async def connected(self, client: viser.ClientHandle) -> None:
        """Handle a browser that connected to viser, whose event loop calls this.

        It is asked to load the picture with a new token.
        """
        token = secrets.token_urlsafe(24)
        client.gui.set_panel_label("symgrasp")
        client.gui.configure_theme(show_logo=False, show_share_button=False)
        with self._lock:
            placeholder = client.gui.add_html(
                f'<div style="{STYLE}">Loading …<img src="{HELLO}{token}" alt="" width="1" height="1"></div>'
            )
            self._waiting[token] = _Waiting(client, current_connection(), placeholder)

    def visited(self, visit: Visit) -> bool:
        """Handle a browser that loaded its picture: open its session.

        Returns:
            Whether the token belongs to a browser that waits for its session.
        """
        with self._lock:
            if self._closed or (waiting := self._waiting.pop(visit.token, None)) is None:
                return False
        waiting.connection.stay()
        threading.Thread(target=self._open, args=(waiting, visit), daemon=True).start()
        return True

    async def show_map(self, connection: BrowserConnection, token: str) -> None:
        """Show the map of a page on a websocket, as soon as its view has a session; on the event loop.

        Args:
            connection: the websocket.
            token: of the page.
        """
        while (session := self._session_of(token)) is None:
            waits = [asyncio.ensure_future(wait) for wait in (self._opened.wait(), connection.wait_closed())]
            await asyncio.wait(waits, return_when=asyncio.FIRST_COMPLETED)
            for wait in waits:
                wait.cancel()
            if connection.state is not State.OPEN:
                return
        connection.stay()
        await session.map_pane.serve(connection)

    def _session_of(self, token: str) -> Session | None:
        with self._lock:
            return self._pages.get(token)

    def disconnected(self, client: viser.ClientHandle) -> None:
        """Handle a browser that disconnected: close its session."""
        with self._lock:
            session = self._sessions.pop(client.client_id, None)
            self._lock.notify_all()
            self._waiting = {
                token: waiting for token, waiting in self._waiting.items() if waiting.client is not client
            }
        if session:
            session.close()
            page = session.visit.page
            if page and (shown := session.shown):
                self._left.keep(page, shown)
            with self._lock:
                if self._pages.get(page) is session:
                    del self._pages[page]

    def _left_by(self, visit: Visit) -> LeftPage | StoredFiles | None:
        """Return what a page showed before it was loaded again; or on an earlier server."""
        tokens = [token for token in (visit.page, visit.before) if token]
        for token in tokens:
            if left := self._shown_on(token):
                return left
        if self._stored:
            for token in tokens:
                if stored := self._stored.find(token):
                    return stored
        return None

    def _shown(self) -> dict[str, LeftPage]:
        """Return what all pages show, or showed last, by their tokens."""
        left = self._left.all()
        with self._lock:
            sessions = dict(self._pages)
        return left | {token: shown for token, session in sessions.items() if (shown := session.shown)}

    def _shown_on(self, token: str) -> LeftPage | None:
        """Return what a page shows, if the server has not noticed yet that it has gone, or showed."""
        session = self._session_of(token)
        return session.shown if session else self._left.find(token)

    def close(self) -> None:
        """Close all sessions and the pool of processes; a second call does nothing."""
        with self._lock:
            closed, self._closed = self._closed, True
        if self._stored and not closed:
            self._stored.close()
        with self._lock:
            sessions, self._sessions = list(self._sessions.values()), {}
            self._waiting.clear()
            self._pages.clear()
            self._lock.notify_all()
        for session in sessions:
            session.close()
        self._pool.close()

    def _open(self, waiting: _Waiting, visit: Visit) -> None:
        client = waiting.client
        try:
            waiting.placeholder.remove()
            left = self._left_by(visit)
            session = Session(client, waiting.connection, self._cache, self._pool, visit, left)
        except Exception as error:
            if self._closed:
                return  # so is the event loop
            log.exception("a session could not be opened")
            client.gui.reset()
            why = escape(shown_paths(f"{type(error).__name__}: {error}"))
            client.gui.add_html(
                f'<div style="{STYLE}">This page could not be opened ({why}). Load it again.</div>'
            )
            return
        with self._lock:
            if not (closed := self._closed):
                self._sessions[client.client_id] = session
                if visit.page:
                    self._pages[visit.page] = session
                waiting.connection.loop.call_soon_threadsafe(self._tell_maps)
        if closed:
            session.close()
        elif waiting.connection.state is not State.OPEN:  # it disconnected while its session was opened
            self.disconnected(client)

    def _tell_maps(self) -> None:
        """Let every websocket that waits for a session look for its own again; on the event loop."""
        opened, self._opened = self._opened, asyncio.Event()
        opened.set()


@dataclass(frozen=True)
class _Waiting:
    """A browser that has not loaded its picture yet, and what it shows until then."""

    client: viser.ClientHandle
    connection: BrowserConnection
    placeholder: viser.GuiHtmlHandle

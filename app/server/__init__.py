"""The server: the proxy in front of viser, the lobby, and one session for each browser."""

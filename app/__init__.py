"""The web page of symgrasp: a session of its own for every browser, served by viser."""

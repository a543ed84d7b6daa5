"""One browser: its session, and the actions that its widgets and its map start."""

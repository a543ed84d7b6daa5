"""Scene files as the page reads and writes them, and links."""

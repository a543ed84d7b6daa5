"""What one browser shows, as immutable data, and every change of it; no widgets, threads or I/O."""

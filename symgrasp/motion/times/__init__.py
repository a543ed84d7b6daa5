"""When a motion is where."""

"""Scenes: the file format, and robots, object, obstacles and tasks built from it."""

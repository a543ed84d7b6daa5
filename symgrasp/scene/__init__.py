"""Scenes: their file format, and the robots, object, obstacles and tasks built from it."""

"""Paths that are proven free: straight ones of the tool, and free motion."""

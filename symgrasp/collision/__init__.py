"""Convex pieces: certified distances, and trees to find near ones."""

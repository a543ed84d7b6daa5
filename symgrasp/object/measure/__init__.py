"""Measuring an object of revolution from a triangle mesh: its axis, profile and deviation from symmetry."""

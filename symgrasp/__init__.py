"""Grasp maps and planners for objects of revolution."""

"""Motions: how the arms get from grasp to grasp, and when."""

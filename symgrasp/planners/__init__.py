"""Planners over feasibility maps: one grasp for a sequence, several hands on one object."""

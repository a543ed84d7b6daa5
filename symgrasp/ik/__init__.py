"""Closed-form inverse kinematics: all branches of a pose at sampled redundancy values."""

from symgrasp.ik.closed_form import ClosedFormIK, Solutions

__all__ = ["ClosedFormIK", "Solutions"]

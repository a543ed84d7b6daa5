"""The exact fast path to the maps of Algorithm 1: certificates first, PyBullet for what they leave open."""

from symgrasp.engine.exact import ExactEngine

__all__ = ["ExactEngine"]

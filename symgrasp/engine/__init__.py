"""The exact fast path to the maps of Algorithm 1: certificates first, PyBullet for what they leave open."""

from symgrasp.engine.exact import ExactEngine, create_map_exact

__all__ = ["ExactEngine", "create_map_exact"]

"""The exact engine: the maps of Algorithm 1 by compiled code, and which of their cells hold as a whole."""

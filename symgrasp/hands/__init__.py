"""Measuring hands in URDFs: which links are fingers, how they close, and where they hold objects."""

"""Measures objects of revolution in meshes: axis, radii, symmetry."""

"""The compiled search of maps: certified distances of convex pieces, and all cells in parallel."""

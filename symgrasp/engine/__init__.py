"""The compiled search for free configurations: convex pieces, certified distances, cells in parallel."""

"""Benchmarks of maps: their times, their errors by grid, and whether what they say is so."""

"""Benchmarks of motions, against what people plan them with today."""

"""Benchmarks of arms: how much of their inverse kinematics is found, and how fast."""

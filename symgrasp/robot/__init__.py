"""Robots: kinematic trees, arms, hands and their prints."""

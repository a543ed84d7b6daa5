"""Robots from URDFs: kinematic trees, arms, hands and their prints."""

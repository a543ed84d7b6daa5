"""What people choose or bring in place of what a scene file has: robots, arms, objects, scenes."""

"""The motion of a plan, part by part."""

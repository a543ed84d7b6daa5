"""The parts of the page beside the 3D view: widgets, what they do, how they follow the state."""

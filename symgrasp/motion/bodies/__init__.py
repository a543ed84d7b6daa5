"""What moves and what stands: the pieces of a scene as linkages."""

"""The 3D view of one browser: robots, object, obstacles, maps as meshes, ghosts."""

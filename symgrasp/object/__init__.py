"""Objects of revolution: profiles, the grid over their surface, and measuring them in meshes."""

"""Objects of revolution: radius profiles, the grasp manifold over their surface, and measuring meshes."""

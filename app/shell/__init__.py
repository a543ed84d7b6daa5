"""The page around the 3D view: its files, the map on it, and what a person does with that map."""

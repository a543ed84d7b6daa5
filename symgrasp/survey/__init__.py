"""Surveys: maps and plans over grids of poses, objects, hands and places, kept in a store that can go on."""

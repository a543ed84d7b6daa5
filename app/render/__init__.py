"""Colours and pictures of maps and handprints, and the frames of a playback."""

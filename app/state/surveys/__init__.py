"""The part of the state about surveys, and its changes."""

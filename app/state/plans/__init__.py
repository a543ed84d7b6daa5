"""The part of the state about plans, and its changes."""

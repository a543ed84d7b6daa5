"""The compiled search of maps: certificates for candidates, and all cells in parallel."""

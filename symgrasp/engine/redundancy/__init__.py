"""The redundancy of an arm, searched everywhere between its samples."""

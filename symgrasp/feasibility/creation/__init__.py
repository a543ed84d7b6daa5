"""The parts that maps are created of: Algorithm 1, drafts, and maps over torso joints and pitches."""

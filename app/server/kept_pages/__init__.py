"""What pages showed whose sessions have ended, in memory and on the disk, until they come back."""

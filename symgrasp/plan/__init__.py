"""The plan file: writing, verifying, exporting and describing plans."""

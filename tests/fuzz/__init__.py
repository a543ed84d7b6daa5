"""Commands on input that nobody meant to write; see `test_fuzz`."""

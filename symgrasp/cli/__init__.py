"""The command line: one module a command, and `symgrasp.cli.main`, which runs them."""

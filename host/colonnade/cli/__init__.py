"""The ``colonnade`` command: one subcommand a file. Heavy imports stay inside the subcommands."""

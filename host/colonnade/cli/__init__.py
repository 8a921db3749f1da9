"""The ``colonnade`` command: one subcommand per file. Heavy imports stay inside the subcommands."""

"""The subcommands of ``colonnade``. Heavy imports stay inside the commands, so that ``--help`` is quick."""

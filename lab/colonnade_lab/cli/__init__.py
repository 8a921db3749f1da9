"""The subcommands of the laboratory. Heavy imports stay inside."""

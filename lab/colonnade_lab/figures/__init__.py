"""The figures of README and docs: `catalog` says what is measured, `measure` measures it, `pages` writes the tables."""

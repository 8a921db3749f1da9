"""``python -m colonnade``: the same as the ``colonnade`` command."""

from colonnade.cli.main import main

if __name__ == "__main__":
    main()

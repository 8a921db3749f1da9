"""The text report of ``colonnade ppa``, and the generated tables of docs/ppa.md."""

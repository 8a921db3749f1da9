"""The report of ``colonnade ppa`` as text, and the tables of docs/ppa.md."""

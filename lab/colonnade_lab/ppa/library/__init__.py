"""Standard-cell libraries: liberty files and the functions of their cells."""

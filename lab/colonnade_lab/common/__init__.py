"""What the measurements share: tables, files, processors."""

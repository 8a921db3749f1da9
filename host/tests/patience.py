"""How long pages of tests may take."""

from __future__ import annotations

#: Milliseconds, beyond what the slowest and busiest machine needs: only a page that hangs fails.
PATIENCE = 3_600_000

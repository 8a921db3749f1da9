"""Frame registers: their values for a scene, as docs/numbers.md defines them."""

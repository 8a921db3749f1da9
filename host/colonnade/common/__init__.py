"""The lowest layer: errors, files, caches, processes, progress display, frames and images."""

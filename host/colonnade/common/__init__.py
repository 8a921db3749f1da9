"""What every layer uses: errors, files, caches, processes, progress, frames and their pixels."""

"""Image quality: metrics that compare two pictures, or the hits of two frames."""

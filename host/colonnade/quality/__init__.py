"""Image quality: how far two pictures, or the hits behind them, are apart."""

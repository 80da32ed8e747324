"""The projectile in a frame: found, fitted to a fraction of a pixel, followed."""

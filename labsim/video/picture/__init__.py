"""What a video shows besides the projectile: background, noise, surface, scale."""

"""One file a material law."""

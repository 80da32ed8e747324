"""Slices, one at a time: read, reconstructed, checked and freed of artefacts."""

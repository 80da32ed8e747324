"""Pixels in, a track and a deceleration curve out."""

"""Pixels in, a track and a deceleration curve out."""

from __future__ import annotations

from .curve import check_drop_height, fit_deceleration
from .track_file import read_track, write_track

__all__ = ["check_drop_height", "fit_deceleration", "read_track", "write_track"]

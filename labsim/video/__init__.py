"""Pixels in, a track and a deceleration curve out."""

from __future__ import annotations

from .formats.folder import read_picture
from .frames import Frames, open_frames
from .motion.checks import check_drop_height
from .motion.curve import fit_deceleration
from .motion.local import fit_local_polynomial
from .overlay import draw_contact_sheet, encode_picture, find_top, write_overlay
from .picture.scale import measure_ruler, scale_from_diameter
from .seen import draw_scene
from .track_file import make_track, read_track, tabulate_curve, tabulate_track, write_curve, write_track
from .tracker import Tracking, follow_projectile, track_projectile

__all__ = [
    "Frames",
    "Tracking",
    "check_drop_height",
    "draw_contact_sheet",
    "draw_scene",
    "encode_picture",
    "find_top",
    "fit_deceleration",
    "fit_local_polynomial",
    "follow_projectile",
    "make_track",
    "measure_ruler",
    "open_frames",
    "read_picture",
    "read_track",
    "scale_from_diameter",
    "tabulate_curve",
    "tabulate_track",
    "track_projectile",
    "write_curve",
    "write_overlay",
    "write_track",
]

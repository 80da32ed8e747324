"""From rows to a motion: its segments, what they leave open, frames that do not fit."""

"""p_m from published figures, as depth and stopping time, in place of records."""

"""Figures, tables and pages; nothing is computed here."""

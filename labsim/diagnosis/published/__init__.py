"""Diagnosis of published figures in place of records."""

"""Pictures: records in, PNG files or figures to hover over out."""

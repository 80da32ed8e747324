"""One file a CT format."""

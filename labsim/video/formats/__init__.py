"""One file a video format."""

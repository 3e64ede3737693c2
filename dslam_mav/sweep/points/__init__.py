"""One point of a sweep, pure: its randomness, its flight estimated, its answer judged, and what many come to."""

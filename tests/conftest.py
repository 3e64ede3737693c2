"""Puts tests/ itself on the import path, for the fakes that several folders share."""

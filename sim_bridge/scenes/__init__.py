"""Scene files that ship with the package."""

"""What needs heavy third-party clients: `make interop`."""

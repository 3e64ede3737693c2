"""The simulated half of a flight: a loopback vehicle, and thermal readings, synthetic or recorded."""

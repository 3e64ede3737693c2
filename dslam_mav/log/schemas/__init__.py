"""Protobuf schemas of the log: `flight.proto`, and what is generated from it (how: at its top)."""

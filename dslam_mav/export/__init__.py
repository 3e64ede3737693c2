"""What leaves a log for other programs: tables of readings, maps of an answer. Pure: bytes out, no file written."""

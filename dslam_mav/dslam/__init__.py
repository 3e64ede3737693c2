"""The paper and what goes beyond it: numpy, scipy and numba only. Knows no MAVLink, no file, no socket, no clock."""

"""The flight log: MCAP with protobuf messages, readable by Foxglove and Rerun, whole up to the last second.

The only place that knows MCAP and protobuf. `Recorder` writes, `read_log` and `log_info` read.
"""

from dslam_mav.log.reader import FlightLog, LoggedEstimate, LogInfo, log_info, read_log
from dslam_mav.log.recorder import Recorder

__all__ = ["FlightLog", "LogInfo", "LoggedEstimate", "Recorder", "log_info", "read_log"]

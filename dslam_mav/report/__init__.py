"""What a person reads after a flight: a self-contained HTML page, a table for the terminal, a JSON object."""

from dslam_mav.report.data import ReportData
from dslam_mav.report.page import render
from dslam_mav.report.table import result_json, result_table

__all__ = ["ReportData", "render", "result_json", "result_table"]

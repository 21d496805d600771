"""A run as one HTML page that needs no network: `write_report`."""

from seqsearch.report.page import write_report

__all__ = ["write_report"]

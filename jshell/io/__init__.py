"""Files: traces and tables in text, JSON, NetCDF, .mat and .npz, conditions in JSON, every refusal with its place."""

from jshell.io.datasets import example
from jshell.io.formats import check_suffix
from jshell.io.headers import read_conditions
from jshell.io.tables import encode_trace, read_table, read_trace, write_trace

__all__ = ["check_suffix", "encode_trace", "example", "read_conditions", "read_table", "read_trace", "write_trace"]

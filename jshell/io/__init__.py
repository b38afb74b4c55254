"""Files: traces and tables in CSV, conditions in JSON, every refusal with its place."""

from jshell.io.headers import read_conditions
from jshell.io.tables import read_table, read_trace, write_trace

__all__ = ["read_conditions", "read_table", "read_trace", "write_trace"]

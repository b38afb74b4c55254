"""Files: traces and tables as laboratories have them, conditions in JSON; guesses told, refusals with their place."""

from jshell.io.choices import Reading
from jshell.io.datasets import example
from jshell.io.formats import check_suffix
from jshell.io.headers import read_conditions
from jshell.io.tables import encode_trace, read_table, read_trace, write_trace

__all__ = [
    "Reading",
    "check_suffix",
    "encode_trace",
    "example",
    "read_conditions",
    "read_table",
    "read_trace",
    "write_trace",
]

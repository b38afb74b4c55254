"""The terminal: one file per group of verbs."""

from jshell.cli import starting as starting

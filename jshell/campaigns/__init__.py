"""Many simulations: designed, run on an engine, catalogued."""

from jshell.campaigns.catalog import Catalog, catalog, failures, shipped
from jshell.campaigns.compare import Comparison, Moved, compare
from jshell.campaigns.design import Design, Family
from jshell.campaigns.findings import Findings
from jshell.campaigns.perform import Result, Versions, perform
from jshell.campaigns.planned import KINDS, Run
from jshell.campaigns.run import Progress, run
from jshell.campaigns.writing import design_text, read_design, write_design

__all__ = [
    "KINDS", "Catalog", "Comparison", "Design", "Family", "Findings", "Moved", "Progress", "Result", "Run", "Versions",
    "catalog", "compare", "design_text", "failures", "perform", "read_design", "run", "shipped", "write_design",
]  # fmt: skip

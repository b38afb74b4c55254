"""Templates, and the few words and numbers that they share."""

import datetime
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jinja2
from fastapi import Request
from fastapi.responses import HTMLResponse

import jshell
from jshell.quantities import QUANTITIES
from jshell.service.safety import COOKIE

STATES = {"queued": "waiting", "running": "running", "done": "done", "failed": "failed", "cancelled": "cancelled"}


def number(value: Any, digits: int = 5) -> str:
    """A number to some digits; a dash where there is none."""
    if value is None or not math.isfinite(float(value)):
        return "–"
    text = f"{float(value):.{digits}g}"
    if "e+" in text and abs(float(value)) < 1e7:  # a pressure in Pa reads better without a power of ten
        text = f"{float(text):.0f}"
    return text.replace("-", "−")


def with_error(value: float, error: float | None) -> str:
    """`1.0757 ± 0.0045`: the error to two digits, the value to the same place."""
    if error is None or not (math.isfinite(error) and error > 0 and math.isfinite(value)):
        return number(value, 6)
    if error < 1e-12 * abs(value) or abs(value) >= 1e7 or error < 1e-6:
        return f"{value:.6g} ± {error:.2g}".replace("-", "−")
    digits = max(1 - math.floor(math.log10(error)), 0)
    return f"{value:.{digits}f} ± {error:.{digits}f}".replace("-", "−")


def moment(seconds: float | None) -> str:
    """A time of the day on a date, in UTC."""
    if seconds is None:
        return "–"
    return datetime.datetime.fromtimestamp(seconds, datetime.UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def symbol(name: str) -> str:
    """A parameter's name as the paper writes it."""
    if "/" in name:
        return "/".join(map(symbol, name.split("/")))
    base, bracket, rest = name.partition("[")
    spelled = {"k_vs": "kVS"}.get(base, base)
    shown = QUANTITIES[spelled].symbol if spelled in QUANTITIES else base
    return shown + bracket + rest


def words(name: str) -> str:
    """What a quantity is, in words; empty where the registry does not know it."""
    base = {"k_vs": "kVS"}.get(name.partition("[")[0], name.partition("[")[0])
    return QUANTITIES[base].words if base in QUANTITIES else ""


def size(count: float | int) -> str:
    """Bytes in a unit of convenient size."""
    for unit in ("B", "kB", "MB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} GB"


ENVIRONMENT = jinja2.Environment(
    loader=jinja2.FileSystemLoader(Path(__file__).parent / "templates"),
    autoescape=True,
    undefined=jinja2.StrictUndefined,
    trim_blocks=True,
    lstrip_blocks=True,
)
ENVIRONMENT.filters |= {
    "number": number, "moment": moment, "symbol": symbol, "words": words, "size": size,
}  # fmt: skip
ENVIRONMENT.globals |= {"with_error": with_error, "version": jshell.__version__, "states": STATES}


def shown(request: Request, template: str, given: Mapping[str, Any], status: int = 200) -> HTMLResponse:
    """A page."""
    settings = request.app.state.service.settings if hasattr(request.app.state, "service") else None
    common = {"path": request.url.path, "logged_in": COOKIE in request.cookies}
    text = ENVIRONMENT.get_template(template).render(**common, **given)
    if (
        root := settings.root_path if settings is not None else ""
    ):  # addresses of ours only: what users write is escaped
        text = re.sub(r'((?:href|src|action|formaction|hx-get|data-src)=")(?=/)', rf"\1{root}", text)
    return HTMLResponse(text, status, headers={"Cache-Control": "no-store"})

"""A fit's result as text, as a page of a notebook and as a JSON object."""

import html
from collections.abc import Iterable

import numpy as np

from jshell.calibration.estimate import Estimate, ParameterTable
from jshell.calibration.result import Fit


def record(result: Fit) -> dict:
    """The result as a JSON object; missing numbers are null."""
    number = lambda x: float(x) if np.isfinite(x) else None  # noqa: E731

    def row(e: Estimate) -> dict:
        return {
            "name": e.name,
            "value": number(e.value),
            "stderr": number(e.stderr),
            "reason": e.reason,
            "start": number(e.start),
            "role": e.role,
        }

    return {
        "title": result.title,
        "outcome": result.outcome.word,
        "estimates": [row(e) for e in result.estimates],
        "derived": [row(e) for e in result.derived],
        "varied": list(result.varied),
        "correlation": [[number(x) for x in line] for line in result.correlation],
        "covariance": [[number(x) for x in line] for line in result.covariance],
        **{name: number(value) for name, value in result.statistics},
        "n_data": result.n_data,
        "n_varied": result.n_varied,
        "errors": "absolute" if result.absolute else "scaled",
        "dipole": result.dipole,
        "free_directions": list(result.free_directions),
        "starts": [
            {
                "values": [number(x) for x in start.values],
                "cost": number(start.cost),
                "outcome": start.outcome.word,
                "steps": start.steps,
                "agrees": start.agrees,
            }
            for start in result.starts
        ],
        "notes": list(result.notes),
        "warnings": list(result.warnings),
    }


def text(result: Fit, *, nuisance: bool = False, smallest_correlation: float = 0.1) -> str:
    """The result as text.

    Args:
        nuisance: Also list what belongs to single traces.
        smallest_correlation: Correlations below are not listed.
    """
    scaled = "given σ, absolute" if result.absolute else "no σ given, scaled by reduced χ²"
    if any(one.memory for one in result.noise):
        scaled += "; autocorrelated noise"
    lines = [
        f"[[{result.title}]]",
        f"    outcome             {result.outcome.word}: {result.advice}",
        "[[Fit statistics]]",
        f"    data                {result.n_data}",
        f"    varied              {result.n_varied} ({len(result.varied)} constants)",
        *(f"    {name.replace('_', ' '):19} {value:.8g}" for name, value in result.statistics),
        f"    errors              {scaled}",
    ]
    lines += ["[[Constants]]", *_indented(ParameterTable(result.estimates).lines(nuisance=nuisance))]
    if result.derived:
        lines += ["[[Derived]]", *_indented(ParameterTable(result.derived).lines())]
    if rows := in_si(result):
        lines += ["[[In SI]] (intrinsic frequencies ω/2π)", *_indented(rows)]
    pairs = _pairs(result, smallest_correlation)
    if pairs:
        lines += [f"[[Correlations]] (below {smallest_correlation:g} not listed)", *pairs]
    if result.starts:
        agree = sum(start.agrees for start in result.starts)
        lines += ["[[Starts]]", f"    {agree} of {len(result.starts)} ended in the same minimum"]
    for title, texts in (
        ("Free directions", result.free_directions),
        ("Notes", result.notes),
        ("Warnings", result.warnings),
    ):
        if texts:
            lines += [f"[[{title}]]", *_indented(texts)]
    return "\n".join(lines)


def in_si(result: Fit) -> list[str]:
    """Frequencies and decay times of recordings that know their units, a line each."""
    scales = [one.scales for one in getattr(result, "traces", ())]
    if not scales or any(one is None for one in scales):
        return []
    shared = len({float(one.time) for one in scales}) == 1
    rows = []
    for e in (*result.estimates, *result.derived):
        base, _, index = e.name.partition("[")
        if base not in ("omega_minus", "omega_plus", "tau") or e.undetermined or not (index or shared):
            continue
        unit = scales[int(index.rstrip("]")) - 1 if index else 0]
        factor, word = (1e3 * unit.time, "ms") if base == "tau" else (unit.frequency, "Hz")
        error = f" ± {e.stderr * factor:.2g}" if np.isfinite(e.stderr) else ""
        rows.append(f"{e.name.replace('omega', 'f')} = {e.value * factor:.5g}{error} {word}")
    return rows


def page(result: Fit) -> str:
    """The report for notebooks."""
    cells = "".join(
        f"<tr><td>{html.escape(e.name)}</td><td>{_value(e)}</td><td>{_error(e)}</td>"
        f"<td>{'' if np.isnan(e.start) else f'{e.start:.5g}'}</td></tr>"
        for e in (*result.estimates, *result.derived)
        if e.role != "nuisance"
    )
    numbers = "".join(f"<tr><td>{k.replace('_', ' ')}</td><td>{v:.8g}</td></tr>" for k, v in result.statistics)
    texts = "".join(
        f"<li>{html.escape(text)}</li>" for text in (*result.free_directions, *result.notes, *result.warnings)
    )
    pairs = "".join(f"<li>{html.escape(text.strip())}</li>" for text in _pairs(result, 0.1))
    return (
        f"<h4>{html.escape(result.title)}</h4><p>{result.outcome.word}: {html.escape(result.advice)}</p>"
        f"<table><tr><th>name</th><th>value</th><th>error</th><th>start</th></tr>{cells}</table>"
        f"<table><tr><td>data</td><td>{result.n_data}</td></tr><tr><td>varied</td><td>{result.n_varied}</td></tr>"
        f"{numbers}</table><ul>{pairs}</ul><ul>{texts}</ul>"
    )


def _pairs(result: Fit, smallest: float) -> list[str]:
    found = []
    for i, one in enumerate(result.varied):
        for j in range(i):
            value = result.correlation[i, j]
            if np.isfinite(value) and abs(value) >= smallest:
                found.append((abs(value), f"    C({result.varied[j]}, {one}) = {value:+.4f}"))
    return [text for _, text in sorted(found, reverse=True)]


def _value(estimate: Estimate) -> str:
    return "undetermined" if estimate.undetermined else f"{estimate.value:.7g}"


def _error(estimate: Estimate) -> str:
    if estimate.role == "fixed":
        return "fixed"
    if np.isfinite(estimate.stderr):
        percent = "" if estimate.percent is None else f" ({estimate.percent:.2f}%)"
        return f"± {estimate.stderr:.4g}{percent}"
    return html.escape(f"none: {estimate.reason or 'not asked for'}")


def _indented(rows: Iterable[str]) -> list[str]:
    return [f"    {row}" for row in rows]

"""What the pages of all reports have in common."""

from __future__ import annotations

from pathlib import Path

import jinja2

from c3_station.figure_style import auv_label
from c3_station.sortie_reach import listed


def page_template(name: str) -> jinja2.Template:
    """Return a template of a page, with filters for numbers."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent / 'templates'),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        'number': _number,
        'signed': _signed,
        'percent': _percent,
        'rounded': _rounded,
        'ratio': _ratio,
        'auv_label': auv_label,
        'cells': listed,
    }
    return environment.get_template(name)


def _number(value: float | None, unit: str = '') -> str:
    """Return a number as a person reads it, with its unit; a dash where there is none."""
    if value is None:
        return '\N{EN DASH}'
    text = f'{value:,.2f}'.rstrip('0').rstrip('.') if value % 1 else f'{value:,.0f}'
    return f'{text}\N{NO-BREAK SPACE}{unit}' if unit else text


def _signed(value: float | None, unit: str = '') -> str:
    """Return a difference, with its sign."""
    if value is None or round(value, 2) == 0:
        return _number(None if value is None else 0.0, unit)
    sign = '+' if value > 0 else '\N{MINUS SIGN}'
    return sign + _number(round(abs(value), 2), unit)


def _percent(share: float | None) -> str:
    return _number(None if share is None else round(100.0 * share, 1), '%')


def _rounded(value: float, unit: str = '') -> str:
    """Return a number with three digits, or all before the point."""
    digits = 0 if abs(value) >= 100 else 1 if abs(value) >= 10 else 2
    return _number(round(value, digits), unit)


def _ratio(value: float | None) -> str:
    """Return a ratio that may be 1, with the digits that tell."""
    return '\N{EN DASH}' if value is None else f'{value:.4f}'

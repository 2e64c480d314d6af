"""
How the figures of a report look.

Drawn 5 inches wide in 10 point type, so that they can be read on a telephone. Colours are those
of Okabe and Ito, told apart with any colour vision, and never the only difference.
"""

from __future__ import annotations

from io import BytesIO
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

BLUE, ORANGE, GREEN = '#0072B2', '#E69F00', '#009E73'
PURPLE, SKY, VERMILLION = '#CC79A7', '#56B4E9', '#D55E00'
BLACK, GREY, PALE = '#000000', '#767676', '#E4E4E4'
LAND = '#BDB3A4'

AUV_COLOURS = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILLION)
AUV_LINES = ('-', '--', ':')
"""With more AUVs than colours, the next round of colours is drawn with the next line."""

WIDTH_IN = 5.0
DPI = 200

STYLE: Any = {  # matplotlib lists every key there is as its type
    'font.size': 10,
    'axes.spines.top': False,
    'axes.spines.right': False,
    'axes.edgecolor': GREY,
    'axes.linewidth': 0.8,
    'xtick.color': '#333333',
    'ytick.color': '#333333',
    'legend.frameon': False,
    'legend.fontsize': 9,
    'figure.facecolor': 'white',
}


def new_figure(height_in: float) -> tuple[Figure, Axes]:
    """Return a figure of a height with one pair of axes."""
    figure = Figure(figsize=(WIDTH_IN, height_in), layout='constrained')
    return figure, figure.subplots()


def png_of(figure: Figure) -> bytes:
    """Return a figure as a PNG file."""
    file = BytesIO()
    figure.savefig(file, format='png', dpi=DPI)
    return file.getvalue()


def auv_colour(number: int) -> str:
    """Return the colour of an AUV by its place in the visiting order, counted from 0."""
    return AUV_COLOURS[number % len(AUV_COLOURS)]


def auv_line(number: int) -> str:
    """Return the line style of an AUV by its place in the visiting order, counted from 0."""
    return AUV_LINES[number // len(AUV_COLOURS) % len(AUV_LINES)]


def auv_label(name: str) -> str:
    """Return an AUV's name as in the paper: A1 for auv_1."""
    return name.replace('auv_', 'A') if name.startswith('auv_') else name


def legend_below(figure: Figure, handles: list[Line2D | Patch], columns: int) -> None:
    """Put a legend under the axes, to be read row by row (matplotlib fills column by column)."""
    rows = -(-len(handles) // columns)
    padded = [*handles, *(Line2D([], [], ls='none', label=' ') for _ in range(columns - 1))]
    figure.legend(
        handles=[padded[row * columns + col] for col in range(columns) for row in range(rows)],
        loc='outside lower center',
        ncols=columns,
        handlelength=1.8,
        columnspacing=1.2,
    )

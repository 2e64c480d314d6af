"""What holds for the pages and the figures of every report."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from itertools import combinations

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text as DrawnText
from matplotlib.transforms import Bbox

from c3_station.figure_style import STYLE


class Page(HTMLParser):
    """Checks that every element is closed, and gathers what would be loaded from elsewhere."""

    VOID = frozenset({'meta', 'img', 'br', 'hr', 'link', 'input'})

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loads: list[str] = []
        self.images = 0
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in self.VOID:
            self.open.append(tag)
        assert tag not in ('script', 'link', 'iframe')
        for name, value in attrs:
            if name in ('src', 'href', 'srcset', 'data') and not (value or '').startswith('data:'):
                self.loads.append(value or '')
        if tag == 'img':
            self.images += 1
            assert dict(attrs)['alt']

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def words(page: str) -> str:
    """Return the text of a page without its markup."""
    body = page.partition('<body>')[2]
    return re.sub(r'\s+', ' ', re.sub(r'<[^>]*>', ' ', body)).replace('\N{NO-BREAK SPACE}', ' ')


def check_texts(figure: Figure) -> None:
    """Check that no text of a figure overlaps another, and none is cut off."""
    canvas = FigureCanvasAgg(figure)
    with mpl.rc_context(STYLE):
        canvas.draw()
    hidden = labels_of_hidden_ticks(figure)
    boxes: list[tuple[str, Bbox]] = [
        (text.get_text(), text.get_window_extent(canvas.get_renderer()))
        for text in figure.findobj(DrawnText)
        if isinstance(text, DrawnText)
        and text.get_visible()
        and text.get_text().strip()
        and text not in hidden
    ]
    assert len(boxes) > 5
    page = figure.bbox
    for text, box in boxes:
        assert page.x0 <= box.x0, text
        assert box.x1 <= page.x1, text
        assert page.y0 <= box.y0, text
        assert box.y1 <= page.y1, text
    for (text, box), (other_text, other_box) in combinations(boxes, 2):
        assert not box.overlaps(other_box), (text, other_text)


def labels_of_hidden_ticks(figure: Figure) -> set[DrawnText]:
    """Return the labels of ticks beyond the ends of an axis, which are there but not drawn."""
    labels: set[DrawnText] = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            drawn_ticks = axis._update_ticks()  # type: ignore[attr-defined]
            labels |= {tick.label1 for tick in axis.get_major_ticks() if tick not in drawn_ticks}
    return labels

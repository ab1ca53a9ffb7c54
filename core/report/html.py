"""A report page: headings, sentences, tables and figures in one HTML file."""

from __future__ import annotations

import base64
import html
import io
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..files import remove_abandoned, whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#222;max-width:62rem;margin:2rem auto;padding:0 1rem}
h1{font-size:1.6rem;border-bottom:3px solid #c9a45c;padding-bottom:.3rem}h2{font-size:1.15rem;margin-top:2rem}
table{border-collapse:collapse;margin:1rem 0;font-variant-numeric:tabular-nums}
th,td{padding:.25rem .7rem;border-bottom:1px solid #ddd;text-align:left}td.n{text-align:right}th{background:#f6f1e6}
figure{margin:1.2rem 0}img{max-width:100%;height:auto}figcaption{color:#555;font-size:.9rem}
p.verdict{font-size:1.15rem;background:#f6f1e6;padding:.7rem 1rem}p.warning{background:#fde9d9;padding:.5rem 1rem}
.scroll{overflow-x:auto}summary{cursor:pointer;color:#2a6f97}
"""
_LONG = 60  # rows up to which a table stands open


class Report:
    """Collects a report's parts in order and writes them as one self-contained page."""

    def __init__(self, title: str, verdict: str = "") -> None:
        self._title, self._parts = title, [f"<h1>{html.escape(title)}</h1>"]
        if verdict:
            self._parts.append(f'<p class="verdict">{html.escape(verdict)}</p>')

    def heading(self, text: str) -> None:
        """Start a section."""
        self._parts.append(f"<h2>{html.escape(text)}</h2>")

    def text(self, text: str) -> None:
        """Add a paragraph."""
        self._parts.append(f"<p>{html.escape(text)}</p>")

    def warning(self, text: str) -> None:
        """Add a paragraph that must not be missed."""
        self._parts.append(f'<p class="warning">{html.escape(text)}</p>')

    def table(self, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
        """Add a table; numbers are aligned right, None is shown as a dash. A long one is folded: a click opens it."""
        listed = list(rows)
        head = "".join(f"<th>{html.escape(c)}</th>" for c in columns)
        body = "".join("<tr>" + "".join(_cell(v) for v in row) + "</tr>" for row in listed)
        table = f'<div class="scroll"><table><tr>{head}</tr>{body}</table></div>'
        folded = f"<details><summary>All {len(listed)} rows</summary>{table}</details>"
        self._parts.append(table if len(listed) <= _LONG else folded)

    def figure(self, figure: Figure, caption: str = "", *, dense: bool = False) -> None:
        """Add a matplotlib figure; one that is ``dense`` with dots takes a third of the bytes as JPEG."""
        stream, kind = io.BytesIO(), "jpeg" if dense else "png"
        figure.savefig(stream, format=kind, dpi=110, bbox_inches="tight", pil_kwargs={"quality": 85} if dense else None)
        self._picture(stream.getvalue(), kind, caption)

    def picture(self, pixels: NDArray[np.uint8], caption: str = "") -> None:
        """Add an image: (rows, columns) grey or (rows, columns, 3) RGB, 8 bits."""
        from PIL import Image

        stream = io.BytesIO()
        # Colour at full resolution, which keeps dots of a pixel or two in theirs.
        Image.fromarray(pixels).save(stream, "JPEG", quality=80, subsampling=0)
        self._picture(stream.getvalue(), "jpeg", caption)

    def save(self, path: Path | str, copy: Path | str | None = None) -> None:
        """Write the page to ``path`` and, when given, to ``copy``."""
        page = (
            f'<!DOCTYPE html><html lang="en"><head><meta charset="utf-8"><title>{html.escape(self._title)}</title>'
            f"<style>{_STYLE}</style></head><body>{''.join(self._parts)}</body></html>\n"
        )
        for target in (path, copy) if copy else (path,):
            remove_abandoned(target)
            with whole(target) as part:
                part.write_text(page, encoding="utf-8")

    def _picture(self, data: bytes, kind: str, caption: str) -> None:
        encoded = base64.b64encode(data).decode()
        self._parts.append(
            f'<figure><img alt="{html.escape(caption)}" src="data:image/{kind};base64,{encoded}">'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>"
        )


def new_figure(width: float = 9.0, height: float = 5.0) -> Figure:
    """Return an empty matplotlib figure (inches) that needs no display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height))
    FigureCanvasAgg(figure)
    return figure


def _cell(value: Any) -> str:
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return '<td class="n">-</td>'
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return f"<td>{html.escape(str(value))}</td>"
    shown = f"{value:.4g}" if isinstance(value, float) and abs(value) < 1000 else f"{value:.0f}"
    return f'<td class="n">{shown}</td>'

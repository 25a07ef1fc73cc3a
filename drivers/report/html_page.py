"""One self-contained page: style, data and scripts inside it, nothing from any network."""

from __future__ import annotations

import json
from html import escape
from pathlib import Path
from typing import Any

ASSETS = Path(__file__).parent / "assets"


def page(title: str, body: str, data: dict[str, Any]) -> str:
    """Return the page with a body that is HTML already; `data` is what its charts draw."""
    # "<" is written as an escape, so that no text within the data can end its element.
    numbers = json.dumps(data, ensure_ascii=False, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    style = (ASSETS / "page.css").read_text(encoding="utf-8")
    scripts = "\n".join(f"<script>\n{(ASSETS / name).read_text(encoding='utf-8')}</script>" for name in ("charts.js", "film.js"))
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        # Nothing may be loaded from anywhere, whatever a scene's texts hold.
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
        "script-src 'unsafe-inline'; img-src data:\">\n"
        f"<title>{escape(title)}</title>\n<style>\n{style}</style>\n</head>\n<body>\n{body}\n"
        f'<script type="application/json" id="data">{numbers}</script>\n{scripts}\n</body>\n</html>\n'
    )


def section(key: str, title: str, *parts: str) -> str:
    """Return a section with a heading, or nothing if it would be empty."""
    inner = "\n".join(part for part in parts if part)
    return f'<section id="{key}">\n<h2>{escape(title)}</h2>\n{inner}\n</section>' if inner else ""


def figures(charts: list[dict[str, Any]], *, two: bool = True) -> str:
    """Return the places of charts, side by side."""
    inner = "\n".join(f'<figure id="chart-{escape(chart["key"], quote=True)}"></figure>' for chart in charts)
    return f'<div class="{"two" if two else "one"}">\n{inner}\n</div>' if charts else ""


def table(heads: list[str], rows: list[list[str]], kind: str = "") -> str:
    """Return a table; a row of one cell is the heading of a group."""
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in heads)
    lines = []
    for row in rows:
        if len(row) == 1 and len(heads) > 1:
            lines.append(f'<tr class="group"><th scope="colgroup" colspan="{len(heads)}">{escape(row[0])}</th></tr>')
        else:
            lines.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>")
    top = f"<thead><tr>{head}</tr></thead>" if any(heads) else ""
    return f'<div class="scroll"><table class="{kind}">{top}<tbody>{"".join(lines)}</tbody></table></div>'

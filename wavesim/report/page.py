"""report.html: a run on one page that needs nothing beside it."""

from __future__ import annotations

import html
import shlex
from pathlib import Path
from typing import Any

from wavesim.report.answers import verdict

_STYLE = """body{font:16px/1.5 system-ui,sans-serif;margin:0 auto;max-width:60rem;padding:1rem}
table{border-collapse:collapse}td,th{padding:.15rem .6rem;text-align:right}
td:first-child,th:first-child{text-align:left}img{max-width:100%}"""


def page(summary: dict[str, Any], case: str, folder: Path) -> str:
    """The page.

    Args:
        summary: contents of summary.json.
        case: the resolved case, TOML.
        folder: of the results.

    Returns:
        HTML.
    """
    title = html.escape(summary["title"] or folder.name)
    command = f"wavesim run {shlex.quote(str(folder / 'resolved.toml'))}"
    parts = [
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{title}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{title}</h1><p>{html.escape(verdict(summary))}</p>",
        *(_table(name, rows) for name, rows in summary["answers"].items() if rows),
        f"<details><summary>All {len(summary['checks'])} checks</summary>",
        _table("", summary["checks"]),
        f"</details><details><summary>The case</summary><pre>{html.escape(case)}</pre></details>",
        f"<p>To repeat it: <code>{html.escape(command)}</code></p></body></html>\n",
    ]
    return "\n".join(parts)


def _table(name: str, rows: list[dict[str, Any]]) -> str:
    headings = "".join(f"<th>{html.escape(key)}</th>" for key in rows[0])
    lines = [
        "<tr>"
        + "".join(f"<td>{html.escape(_text(value))}</td>" for value in row.values())
        + "</tr>"
        for row in rows
    ]
    heading = f"<h2>{html.escape(name.capitalize())}</h2>" if name else ""
    return f"{heading}<table><tr>{headings}</tr>{''.join(lines)}</table>"


def _text(value: Any) -> str:
    if value is None:
        return "–"
    return f"{value:.6g}" if isinstance(value, float) else str(value)

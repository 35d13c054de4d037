"""report.html: a run on one page that needs nothing beside it, and no network.

Plots are drawn in the browser by plotly.js, which travels in the page; its Python package is looked
up for that one file and never imported.
"""

from __future__ import annotations

import functools
import importlib.util
import json
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from wavesim.report.answers import (
    KINDS,
    Answer,
    Column,
    answers,
    checked_in,
    measured_and_allowed,
    number,
    shown,
    verdict,
)

_ASSETS = Path(__file__).parent / "assets"
_KIBI = 1024.0


def page(
    summary: Mapping[str, Any],
    data: Mapping[str, Any],
    case: str,
    folder: Path,
    rerun: str = "",
    notes: Sequence[str] = (),
) -> str:
    """The page.

    Args:
        summary: contents of summary.json.
        data: of ``report.page_data``.
        case: the resolved case, TOML.
        folder: of the results.
        rerun: the command that ran the case, as its user gave it; that of resolved.toml where "".
        notes: what the record was too short, or the grid too coarse, to tell.

    Returns:
        HTML.
    """
    repeat = f"wavesim run {shlex.quote(str(folder / 'resolved.toml'))}"
    checks = summary["checks"]
    return _template().render(
        title=summary["title"] or folder.name,
        summary=summary,
        verdict=verdict(summary),
        tables=[_table(answer) for answer in answers(summary)],
        short=[_fell_short(check) for check in checks if not check["passed"]],
        notes=list(notes),
        closer=_closer(summary, folder, rerun or repeat),
        checks=[_check(check) for check in checks],
        repeat=repeat,
        facts=_facts(summary),
        case=case,
        summary_json=_script(summary),
        data_json=_script(data),
        time_unit=data["time_unit"],
        style=_asset("page.css"),
        script=_asset("page.js"),
        plotly=_plotly(),
    )


@functools.cache
def _template() -> Any:
    from jinja2 import Environment

    environment = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string((_ASSETS / "page.html").read_text(encoding="utf-8"))


def _markup(text: str) -> Any:
    from markupsafe import Markup

    return Markup(text)


@functools.cache
def _asset(name: str) -> Any:
    return _markup((_ASSETS / name).read_text(encoding="utf-8"))


@functools.cache
def _plotly() -> Any:
    found = importlib.util.find_spec("plotly")
    assert found is not None
    assert found.submodule_search_locations is not None
    file = Path(found.submodule_search_locations[0]) / "package_data" / "plotly.min.js"
    return _markup(file.read_text(encoding="utf-8").replace("</script", "<\\/script"))


def _script(value: Any) -> Any:
    """JSON that no end tag within can end."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return _markup(text.replace("<", "\\u003c"))


def _table(answer: Answer) -> dict[str, Any]:
    columns = [
        {
            "name": c.name.replace("\n", " "),
            "kind": c.kind,
            "unit": c.unit,
        }
        for c in answer.columns
    ]
    rows = [
        [
            {
                "value": _digits(row.get(c.key)) if c.kind else None,
                "kind": c.kind,
                "digits": KINDS[c.kind][2] if c.kind else None,
                "bound": c.bound(row),
                "text": c.shown(row),
                "label": _heading(c),
            }
            for c in answer.columns
        ]
        for row in answer.rows
    ]
    return {"title": answer.title, "columns": columns, "rows": rows, "note": answer.note}


def _heading(column: Column) -> str:
    """Of a column with its unit, in one line."""
    return f"{column.name} {column.unit}".replace("\n", " ").strip()


def _digits(value: Any) -> str | None:
    return None if value is None else repr(value)


def _check(check: Mapping[str, Any]) -> dict[str, Any]:
    factor, unit = checked_in(check)
    numbers = [
        {"label": key, "value": "none" if v is None else repr(v),
         "text": number(v if v is None else v * factor)}
        for key, v in ((key, check[key]) for key in ("measured", "reference", "tolerance"))
    ]  # fmt: skip
    return {"name": check["name"], "numbers": numbers, "unit": unit, "passed": check["passed"]}


def _fell_short(check: Mapping[str, Any]) -> dict[str, str]:
    remedy = check.get("remedy", "")
    measured, allowed = measured_and_allowed(check)
    return {
        "name": check["name"],
        "measured": measured,
        "tolerance": allowed,
        "remedy": f"{remedy[:1].upper()}{remedy[1:]}." if remedy else "",
    }


def _closer(summary: Mapping[str, Any], folder: Path, rerun: str) -> list[dict[str, str]]:
    """The commands, or the words, that show more of gaps, each with those that it shows."""
    told_of = summary.get("answers", {})
    by_command: dict[str, list[str]] = {}
    for row in (*told_of.get("gaps", ()), *told_of.get("transmission", ())):
        if row["closer"]:
            what = row.get("gap") or f"{row['where']}, {shown(row['sector'], '')}"
            by_command.setdefault(row["closer"], []).append(what)
    found = []
    for told, names in by_command.items():
        gaps = list(dict.fromkeys(names))  # both transverse sectors have the same
        name = gaps[0].split(",")[0].split()[-1] if len(gaps) == 1 else "closer"
        out = shlex.quote(f"{folder}_{name}")
        command = f"{_laid_over(rerun, told)} --out {out}" if told.startswith("--set") else told
        finer = "time.duration=" in told
        why = "driven there" if command != told else ""
        why = "frequencies twice as fine, in four times the time and disk" if finer else why
        found.append({"name": ", ".join(gaps) + f": {why}" * bool(why), "command": command})
    return found


def _laid_over(command: str, changes: str) -> str:
    """A command with more of --set, those of the same keys left out."""
    words, new = shlex.split(command), shlex.split(changes)
    keys = {word.split("=")[0] for word in new[1::2]}
    old = [words[n - 1 : n + 1] for n in range(1, len(words)) if words[n - 1] == "--set"]
    first = words[: words.index("--set")] if old else words
    same = (word for pair in old if pair[1].split("=")[0] not in keys for word in pair)
    return shlex.join([*first, *same, *new])


def _facts(summary: Mapping[str, Any]) -> list[tuple[str, str]]:
    versions = ", ".join(f"{name} {version}" for name, version in summary["versions"].items())
    times = ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in summary["timing"].items())
    return [
        ("versions", versions),
        ("stepper", f"{summary['stepper']}, {summary['steps']} steps of {summary['step']:.4g} s, "
                    f"{summary['operator_products']} products"),
        ("grid", f"{summary['cells']} cells, fields {', '.join(summary['fields'])}"),
        ("time", times),
        ("memory", f"{summary['peak_memory_bytes'] / _KIBI**2:.0f} MiB at most"),
    ]  # fmt: skip

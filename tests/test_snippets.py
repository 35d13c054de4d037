"""What the documents tell a reader to type works: each page's commands and programs, from top to
bottom, in one folder that has cases/ and docs/ beside it."""

import re
import shlex
from pathlib import Path

import jax
import pytest
from runs import SHIPPED, call

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
# Capitals and brackets stand for what a reader fills in.
SYNOPSIS = re.compile(
    r"\[|\||…|\.\.\.|\b(CASE|FILE|FOLDER|RECORD|TRUTH|POINTS|NAME|KEY|DIR|HOST)\b"
)
ITEM = re.compile(
    r"^```python\n(?P<program>.*?)^```"
    r"|^```(?:sh|bash|console)\n(?P<shell>.*?)^```"
    r"|^    (?P<line>(?:\$ )?wavesim .*?)$",
    re.M | re.S,
)


def items(page: Path) -> list[str | list[str]]:
    """Programs, and words of commands, in the order in which they stand."""
    found: list[str | list[str]] = []
    for item in ITEM.finditer(page.read_text(encoding="utf-8").replace("\\\n", " ")):
        if item["program"]:
            found.append(item["program"])
            continue
        for line in (item["shell"] or item["line"]).splitlines():
            words = re.sub(r"\s{2,}#.*|\s#\s.*", "", line.removeprefix("$ "))
            if words.startswith("wavesim ") and not SYNOPSIS.search(words):
                found.append(shlex.split(words)[1:])
    return found


TOLD = {page: items(page) for page in PAGES}


def test_pages_have_commands_and_programs():
    every = [item for found in TOLD.values() for item in found]
    assert sum(isinstance(item, str) for item in every) >= 5
    assert sum(isinstance(item, list) for item in every) >= 5


@pytest.mark.parametrize("page", [p for p in PAGES if TOLD[p]], ids=lambda page: page.stem)
def test_a_page_works_from_top_to_bottom(page, tmp_path, monkeypatch, shipped):
    """No command ends in bad input or a failure; a check may fall short where the page shows it."""
    for there in ("cases", "docs"):
        (tmp_path / there).symlink_to(ROOT / there)
    (tmp_path / "outputs").mkdir()
    monkeypatch.chdir(tmp_path)
    for case in set(re.findall(r"outputs/(\w+)/", page.read_text(encoding="utf-8"))) & set(SHIPPED):
        folder = tmp_path / "outputs" / case
        folder.mkdir()
        for file in shipped(case).folder.iterdir():
            (folder / file.name).symlink_to(file)
    for item in TOLD[page]:
        if isinstance(item, str):
            file = re.match(r"# (\w+\.py)\b", item)
            if file:
                Path(file[1]).write_text(item, encoding="utf-8")
            else:
                with jax.numpy_dtype_promotion("standard"):  # as it is for who types it
                    exec(compile(item, str(page), "exec"), {"__name__": "page"})
        elif item[0] == "run" and len(item) == 2 and Path(item[1]).stem in SHIPPED:
            continue  # the shipped cases have tests of their own
        else:
            words = [sorted(map(str, Path().glob(w))) if "*" in w else [w] for w in item]
            told = call(*(word for found in words for word in found))
            assert told.exit_code in (0, 1), f"{item}: {told.stderr}"

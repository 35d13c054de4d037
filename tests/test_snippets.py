"""What the documents tell a reader to type works: each page's commands and programs, from top to
bottom, in one folder that has cases/ and docs/ beside it."""

import re
import shlex
from pathlib import Path

import pytest
from runs import SHIPPED, call

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
# Capitals and brackets stand for what a reader fills in.
SYNOPSIS = re.compile(r"\[|…|\.\.\.|\b(CASE|FILE|FOLDER|RECORD|TRUTH|POINTS|NAME|KEY|DIR)\b")


def programs(page: Path) -> list[str]:
    """Programs in Python on a page."""
    return re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)


def files(page: Path) -> dict[str, str]:
    """Programs that say in their first line which file they are."""
    named = {re.match(r"# (\w+\.py)\b", text): text for text in programs(page)}
    return {told[1]: text for told, text in named.items() if told}


def commands(page: Path) -> list[list[str]]:
    """Words of each command of wavesim on a page that stands there as it is to be typed."""
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    fenced = "\n".join(re.findall(r"^```(?:sh|bash|console)\n(.*?)^```", text, re.M | re.S))
    lines = re.findall(r"^    (?:\$ )?wavesim (.*)$", text, re.M)
    lines += re.findall(r"^(?:\$ )?wavesim (.*)$", fenced, re.M)
    plain = [re.sub(r"\s{2,}#.*|\s#\s.*", "", line) for line in lines]
    return [shlex.split(line) for line in plain if not SYNOPSIS.search(line)]


def name(page: Path) -> str:
    return page.stem


def begin(folder: Path, monkeypatch) -> None:
    for there in ("cases", "docs"):
        (folder / there).symlink_to(ROOT / there)
    monkeypatch.chdir(folder)


def test_pages_have_commands_and_programs():
    assert sum(len(commands(page)) for page in PAGES) >= 5
    assert sum(len(programs(page)) for page in PAGES) >= 3


@pytest.mark.parametrize("page", [p for p in PAGES if commands(p)], ids=name)
def test_commands_of_a_page_work(page, tmp_path, monkeypatch, shipped):
    """None ends in bad input or a failure; a check may fall short where the page shows that."""
    begin(tmp_path, monkeypatch)
    (tmp_path / "outputs").mkdir()
    for file, program in files(page).items():
        (tmp_path / file).write_text(program, encoding="utf-8")
    text = " ".join(" ".join(words) for words in commands(page))
    for case in set(re.findall(r"outputs/(\w+)", text)) & set(SHIPPED):
        (tmp_path / "outputs" / case).symlink_to(shipped(case).folder)
    for words in commands(page):
        if words[0] == "run" and Path(words[1]).stem in SHIPPED and len(words) == 2:
            continue  # the shipped cases have tests of their own
        told = call(*words)
        assert told.exit_code in (0, 1), f"{words}: {told.stderr}"


@pytest.mark.parametrize("page", [p for p in PAGES if programs(p)], ids=name)
def test_programs_of_a_page_work(page, tmp_path, monkeypatch):
    begin(tmp_path, monkeypatch)
    for program in programs(page):
        if program in files(page).values():
            continue
        exec(compile(program, str(page), "exec"), {"__name__": "page"})

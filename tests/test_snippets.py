"""What the documents tell a reader to type works: each page's commands and programs, from top to
bottom, in one folder that has cases/ and docs/ beside it; and prints the lines that are shown."""

import re
import shlex
from dataclasses import dataclass
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
    r"|^    (?P<line>(?:\$ )?wavesim [^\n]*)$(?P<shown>(?:\n    (?!\$ |wavesim )[^\n]+)*)",
    re.M | re.S,
)


@dataclass(frozen=True)
class Command:
    """A command's words, and the lines that a page shows of what it prints."""

    words: list[str]
    shown: list[str]


def items(page: Path) -> list[str | Command]:
    """Programs and commands, in the order in which they stand."""
    found: list[str | Command] = []
    for item in ITEM.finditer(page.read_text(encoding="utf-8").replace("\\\n", " ")):
        if item["program"]:
            found.append(item["program"])
            continue
        for line in (item["shell"] or item["line"]).splitlines():
            words = re.sub(r"\s{2,}#.*|\s#\s.*", "", line.removeprefix("$ "))
            if words.startswith("wavesim ") and not SYNOPSIS.search(words):
                shown = (item["shown"] or "").splitlines()[1:]
                found.append(Command(shlex.split(words)[1:], shown))
    return found


RUNS = [["run", f"cases/{name}.toml"] for name in SHIPPED]
ONCE = RUNS + [[*run, "--out", f"outputs/{Path(run[1]).stem}"] for run in RUNS]
# Its program is run, and held to what it promises, by test_receivers_in_batches.
ELSEWHERE = {"through-the-pulse"}
TOLD = {page: items(page) for page in PAGES if page.stem not in ELSEWHERE}


def test_pages_have_commands_and_programs():
    every = [item for found in TOLD.values() for item in found]
    assert sum(isinstance(item, str) for item in every) >= 5
    assert sum(isinstance(item, Command) for item in every) >= 5


@pytest.mark.parametrize("page", [p for p in TOLD if TOLD[p]], ids=lambda page: page.stem)
def test_a_page_works_from_top_to_bottom(page, tmp_path, monkeypatch, shipped):
    """No command ends in bad input or a failure; a check may fall short where the page shows it."""
    for there in ("cases", "docs"):
        (tmp_path / there).symlink_to(ROOT / there)
    monkeypatch.chdir(tmp_path)
    for case in set(re.findall(r"outputs/(\w+)", page.read_text(encoding="utf-8"))) & set(SHIPPED):
        folder = tmp_path / "outputs" / case
        folder.mkdir(parents=True)
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
        elif item.words in ONCE:
            continue  # the shipped cases have tests of their own
        else:
            words = [sorted(map(str, Path().glob(w))) if "*" in w else [w] for w in item.words]
            told = call(*(word for found in words for word in found))
            assert told.exit_code in (0, 1), f"{item}: {told.stderr}"
            printed = " ".join(told.output.split())
            for line in item.shown:
                assert " ".join(line.split()) in printed, item

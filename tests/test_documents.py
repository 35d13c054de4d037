"""What the documents name is there: links, files, modules, commands, keys of a case."""

import ast
import re
from pathlib import Path

import pytest

from wavesim.case.schema import CaseFile
from wavesim.cli.main import main

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    path for path in (*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("benchmarks/*.md"))
)
COMMANDS = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
KEYS = (ROOT / "docs" / "case-file.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page):
    text = page.read_text(encoding="utf-8")
    targets = re.findall(r"\]\(([^)#\s]+)", text)
    missing = [t for t in targets if "://" not in t and not (page.parent / t).exists()]
    assert missing == []
    # Paths from the root, as they stand in commands and in text.
    paths = re.findall(r"(?<![\w./])(?:cases|docs|tests|benchmarks|wavesim)/[\w./]+\.\w+", text)
    assert [p for p in paths if not (ROOT / p).exists()] == []


def test_every_room_has_its_line_and_every_file_its_own():
    """A room in docs/architecture.md, which names no file that is not there; a file in itself."""
    text = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    package = ROOT / "wavesim"
    modules = [path for path in package.rglob("*.py") if path.name != "__init__.py"]
    named = set(re.findall(r"`(?:(?!tests)\w+/)*(\w+\.py)`", text))
    assert named <= {path.name for path in modules}
    rooms = {p.name + "/" for p in package.iterdir() if (p / "__init__.py").exists()}
    assert rooms | {"runner.py", "worker.py"} == set(re.findall(r"^\| `([\w./]+)` \|", text, re.M))
    for path in modules:
        assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))), path


def test_every_command_is_told_of_and_none_besides():
    told = set(re.findall(r"^    wavesim (\w+) ", COMMANDS, re.MULTILINE))
    assert told == set(main.commands)


def test_every_key_of_a_case_is_told_of():
    """Those of [bar], [time], [analysis]; media and sources have tables of their own."""
    for name in ("bar", "time", "analysis"):
        table = CaseFile.model_fields[name].annotation
        missing = [key for key in table.model_fields if f"`{key}`" not in KEYS]
        assert missing == [], name


def test_every_public_name_is_in_the_reference_and_every_page_in_the_index():
    import wavesim

    docs = ROOT / "docs"
    reference = (docs / "reference.md").read_text(encoding="utf-8")
    told = set(re.findall(r"auto(?:class|function):: wavesim\.(\w+)$", reference, re.M))
    modules = {"planewave", "layeredwave"}
    assert told == set(wavesim.__all__) - modules
    assert all(f"ws.{name}" in reference for name in modules)
    index = (docs / "index.md").read_text(encoding="utf-8").splitlines()
    pages = {path.stem for path in (*docs.glob("*.md"), *docs.glob("*.ipynb"))} - {"index"}
    assert pages <= set(index)

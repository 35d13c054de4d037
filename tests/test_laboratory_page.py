"""Each command of docs/laboratory.md runs; those of pulse tests print the lines that are shown."""

import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from wavesim.cli.main import main

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "laboratory.md").read_text(encoding="utf-8")


def examples():
    """[(command, lines shown after it)] in order; lines that end in a backslash are joined."""
    found = []
    for line in PAGE.replace("\\\n", "").splitlines():
        if line.startswith("    $ wavesim "):
            found.append((line.removeprefix("    $ wavesim "), []))
        elif line.startswith("    ") and found and found[-1] is not None:
            found[-1][1].append(line.strip())
        elif found and found[-1] is not None:
            found.append(None)
    return [one for one in found if one is not None]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    folder = tmp_path_factory.mktemp("laboratory")
    for name in ("cases", "docs"):
        (folder / name).symlink_to(ROOT / name)
    return folder


def test_every_example_runs_and_prints_what_the_page_shows(place, monkeypatch):
    """In the page's order, as later ones read what earlier ones wrote."""
    monkeypatch.chdir(place)
    told = examples()
    assert len(told) >= 7
    for command, lines in told:
        words = []
        for word in shlex.split(command):
            words += sorted(map(str, Path().glob(word))) if "*" in word else [word]
        result = CliRunner().invoke(main, words)
        assert result.exit_code == 0, f"{command}: {result.output}"
        if words[0] not in ("pulse", "compare", "fit"):
            continue
        printed = re.sub(r"\s+", " ", result.output)
        for line in lines:
            assert re.sub(r"\s+", " ", line) in printed, command

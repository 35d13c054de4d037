"""Where a first case comes from: a template, the shipped cases by name, a schema, completion."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
from runs import SHIPPED, call

from wavesim.case import shipped as shipped_cases
from wavesim.case.json_schema import json_schema
from wavesim.case.load import load

ROOT = Path(__file__).parents[1]


def test_init_writes_a_case_that_passes_check_and_overwrites_nothing(tmp_path):
    path = tmp_path / "mine.toml"
    done = call("init", path)
    assert done.exit_code == 0
    assert f"wavesim run {path}" in done.output
    checked = call("check", path)
    assert (checked.exit_code, checked.stderr) == (0, "")
    before = path.read_text()
    again = call("init", path)
    assert again.exit_code == 2
    assert "is there already" in again.stderr
    assert path.read_text() == before


def test_every_key_that_the_template_offers_is_one_of_its_table(tmp_path):
    path = tmp_path / "all.toml"
    call("init", path)
    known, table, offered = json_schema()["$defs"], "", set()
    of = {"[medium]": "MediumTable", "[bar]": "BarTable", "[[layers]]": "LayerTable",
          "[[sources]]": "RickerTable", "[[receivers]]": "ReceiverTable", "[time]": "TimeTable",
          "[analysis]": "AnalysisTable"}  # fmt: skip
    for line in path.read_text().splitlines():
        text = line.removeprefix("# ")
        if text.startswith("["):
            table = of[text.split()[0]]
        key, equals, _ = text.partition(" = ")
        if equals and key.isidentifier() and table and key != "kind":
            assert key in known[table]["properties"], line
            offered.add(key)
    assert {"density", "quality_band", "thickness", "width", "solver", "k_max"} <= offered


def test_cases_lists_those_there_are_and_prints_one():
    listed = call("cases").stdout
    for name, path in SHIPPED.items():
        assert f"{name} " in listed
        assert call("cases", name, "--show").stdout == path.read_text(encoding="utf-8")
    assert all(len(line) <= 80 for line in listed.splitlines())
    wrong = call("cases", "slap")
    assert wrong.exit_code == 2
    assert "slab" in wrong.stderr


def test_a_shipped_case_is_found_by_its_name_from_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert load("slab").simulation == load(SHIPPED["slab"]).simulation
    assert call("bands", "slab", "--json").exit_code == 0
    short = ("--set", "time.duration=2e-5", "--quiet")
    done = call("cases", "free_bar", "--out", "here", *short)
    assert done.exit_code in (0, 1)
    assert (tmp_path / "here" / "report.html").exists()
    assert "did you mean slab" in call("check", "slap").stderr
    # A file of that name comes first.
    (tmp_path / "slab").write_text("title = 5")
    assert call("bands", "slab").exit_code == 2


def test_installed_cases_are_those_of_the_package(tmp_path, monkeypatch):
    """In a wheel they lie in the package; there they are looked for first."""
    wheel = subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", str(tmp_path), str(ROOT)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if wheel.returncode:
        pytest.skip(f"no wheel can be built here: {wheel.stderr.strip().splitlines()[-1]}")
    (file,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(file) as packed:
        names = set(packed.namelist())
    assert {f"wavesim/cases/{name}.toml" for name in SHIPPED} <= names
    assert {"wavesim/case/first_case.toml", "wavesim/report/assets/page.js"} <= names
    inside = tmp_path / "wavesim"
    (inside / "cases").mkdir(parents=True)
    monkeypatch.setattr(shipped_cases, "_PACKAGE", inside)
    assert shipped_cases.folder() == inside / "cases"


def test_schema_takes_every_shipped_case_and_refuses_a_misspelt_key():
    jsonschema = pytest.importorskip("jsonschema")
    made = json.loads(call("schema").stdout)
    check = jsonschema.Draft202012Validator(made)
    check.check_schema(made)
    for path in SHIPPED.values():
        assert list(check.iter_errors(tomllib.loads(path.read_text(encoding="utf-8")))) == []
    tables = tomllib.loads(SHIPPED["slab"].read_text(encoding="utf-8"))
    for table, key, value in (
        ("bar", "lenght", 1.0),
        ("bar", "order", 7),
        ("medium", "closure", "other"),
        ("time", "duration", -1.0),
    ):
        wrong = tables | {table: tables[table] | {key: value}}
        assert list(check.iter_errors(wrong)), key
    for family, right in (("u", False), (["u"], False), (["translation", "rotation"], True)):
        assert check.is_valid({"medium": {"family": family}}) == right
    keys = made["$defs"]["MediumTable"]["properties"]
    assert "(kg/m³)" in keys["density"]["description"]
    for table, unit in (("LayerTable", "(m)"), ("BandTable", "(Hz)"), ("WishTable", "(Hz)")):
        assert unit in made["$defs"][table]["properties"]["from"]["description"], table
    assert '"null"' not in json.dumps(made)


def test_init_writes_the_schema_where_editors_look(tmp_path):
    path = tmp_path / "case.toml"
    assert call("init", path, "--schema").exit_code == 0
    first = path.read_text().splitlines()[0]
    beside = tmp_path / first.removeprefix("#:schema ./")
    assert json.loads(beside.read_text()) == json_schema()


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_prints_a_script(shell):
    done = call("completion", shell)
    assert done.exit_code == 0
    assert "_WAVESIM_COMPLETE" in done.stdout


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("wavesim ru", "run"),
        ("wavesim run sla", "slab"),
        ("wavesim run slab --fig", "--figures"),
        ("wavesim check slab --set medium.ani", "medium.anisotropy="),
    ],
)
def test_shell_completes_commands_cases_and_keys(typed, offered):
    words = {"COMP_WORDS": typed, "COMP_CWORD": str(len(typed.split()) - 1)}
    done = subprocess.run(
        [sys.executable, "-c", "from wavesim.cli.main import main; main(prog_name='wavesim')"],
        env=os.environ | words | {"_WAVESIM_COMPLETE": "bash_complete"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert f"plain,{offered}" in done.stdout.splitlines()

"""Imports run one way. What each module may lean on is read off its text, not off a run."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "wavesim"
PATHS = {path.stem: path for path in sorted(PACKAGE.rglob("*.py")) if path.stem != "__init__"}
MODULES = list(PATHS)
ROOMS = {"wavesim", *(f"wavesim.{room.parent.name}" for room in PACKAGE.glob("*/__init__.py"))}

# What the spectral solver shares with the time domain ends here; it must never see a grid.
GRID_AND_TIME = {
    "bar", "stencils", "closures", "operator", "forcing", "response", "steppers", "propagator",
    "kernels", "timestep", "plan", "integration", "field", "zones", "pieces", "pushes", "layered",
    "barequation", "barseries", "barwork", "expansion", "within", "ends", "group", "generator",
    "assembly", "program",
}  # fmt: skip
# Modules that must load without jax, so that a case is checked and bands are drawn at once.
WITHOUT_JAX = {
    "medium", "tensors", "equations", "sectors", "eigenproblem", "planewave", "bar", "stencils",
    "closures", "source", "field", "case", "casemessages", "problem", "plan", "timestep",
    "dispersion", "transmission", "analysis", "verdict", "report", "bands", "storage", "zones",
}  # fmt: skip


def imports(name):
    """Every module that a module imports, anywhere in its text: (wavesim modules, others)."""
    own, others = set(), set()
    for node in ast.walk(ast.parse(PATHS[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: relative import"
            found = [node.module]
            if node.module in ROOMS:
                found = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for full in found:
            root, _, rest = full.partition(".")
            if root == "wavesim":
                own.add(rest.rpartition(".")[2])
            else:
                others.add(root)
    return own & set(MODULES), others


GRAPH = {name: imports(name) for name in MODULES}


def reached(name, seen=None):
    """All modules of wavesim that one leans on, directly or not."""
    seen = set() if seen is None else seen
    for other in GRAPH[name][0] - seen:
        seen.add(other)
        reached(other, seen)
    return seen


def importers(package):
    return {name for name in MODULES if package in GRAPH[name][1]}


def test_the_package_is_read():
    assert len(MODULES) > 25
    assert "integration" in GRAPH["runner"][0]
    assert "jax" in GRAPH["integration"][1]


@pytest.mark.parametrize("name", MODULES)
def test_no_module_leans_on_itself(name):
    assert name not in reached(name)


def test_only_storage_knows_hdf5():
    """Two modules write result.h5, contents and chunks. The reader of any file is another."""
    assert importers("h5py") == {"storage", "gathering", "resultfile"}
    assert "storage" in importers("h5py")


def test_only_figures_know_matplotlib():
    for name in importers("matplotlib"):
        drawing = ("figure", "axes", "drawing", "reproduction")
        assert any(part in name for part in drawing), name
    assert "figures" in importers("matplotlib")


def test_only_the_terminal_knows_rich_and_click():
    commands = {name for name in MODULES if name.endswith("cli")}
    assert importers("click") <= {*commands, "terminal"}
    assert importers("rich") <= {*commands, "terminal", "report", "progress"}


def test_only_case_files_know_pydantic():
    assert importers("pydantic") <= {
        "case", "casemessages", "casetable", "casemedia", "casesources"
    }  # fmt: skip


def test_nothing_imports_the_commands():
    for name in MODULES:
        if not name.endswith("cli"):
            assert not [other for other in GRAPH[name][0] if other.endswith("cli")], name


def spectral_side():
    """planewave, and all that it leans on."""
    return {"planewave", *reached("planewave")}


def test_spectral_solver_knows_no_grid():
    """The check is worth something because the two routes share only the medium."""
    side = spectral_side()
    assert {"medium", "sectors", "eigenproblem"} <= side
    assert not side & GRID_AND_TIME
    for name in side:
        assert not {"jax", "diffrax", "equinox"} & GRAPH[name][1], name
    for name in ("bands", "bandfigure"):
        assert not reached(name) & GRID_AND_TIME


def test_exact_bars_know_no_grid():
    """Nor does the route that layered, damped, finite bars are held against."""
    side = {"layeredwave", *reached("layeredwave")}
    assert {"layers", "damping", "synthesis", "star"} <= side
    assert not side & GRID_AND_TIME
    for name in side:
        assert not {"jax", "diffrax", "equinox"} & GRAPH[name][1], name


def test_time_domain_knows_no_spectral_solver():
    """And the other way round: operator, sources and steppers use no dispersion relation."""
    for name in ("operator", "forcing", "response", "steppers", "stencils", "bar", "timestep"):
        assert not reached(name) & {"planewave", "eigenproblem", "evanescent", "bandedges"}, name


def test_measurement_knows_no_dispersion_relation():
    """What is measured is measured; the theory enters in the verdict."""
    for name in ("dispersion", "transmission", "analysis", "field"):
        assert not reached(name) & {
            "planewave",
            "eigenproblem",
            "evanescent",
            "bandedges",
            "verdict",
        }


def test_only_one_module_integrates():
    """diffrax.diffeqsolve is called in one place."""
    calls = {
        name
        for name in MODULES
        for node in ast.walk(ast.parse(PATHS[name].read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute | ast.Name)
        and getattr(node, "attr", getattr(node, "id", "")) == "diffeqsolve"
    }
    assert calls == {"program"}


@pytest.mark.parametrize("name", sorted(WITHOUT_JAX))
def test_text_names_no_jax(name):
    """Neither the module nor anything that it leans on imports jax, not even inside a function."""
    for other in {name, *reached(name)}:
        assert not {"jax", "diffrax", "equinox"} & GRAPH[other][1], f"{name} through {other}"


def loaded(program, *arguments):
    """Packages that a fresh process has loaded after a program."""
    end = "\nimport sys; print('LOADED', *sorted({m.partition('.')[0] for m in sys.modules}))"
    done = subprocess.run(
        [sys.executable, "-c", program + end, *arguments],
        capture_output=True, text=True, timeout=60, check=True,
    )  # fmt: skip
    return set(done.stdout.partition("LOADED ")[2].split())


HEAVY = {"jax", "diffrax", "equinox", "matplotlib"}
COMMAND = (
    "import sys\nfrom wavesim.cli.main import main\n"
    "try: main(sys.argv[1:])\nexcept SystemExit as stop: assert not stop.code, stop.code"
)


@pytest.mark.parametrize(
    ("program", "arguments", "absent"),
    [
        ("import wavesim", (), {*HEAVY, "numpy", "scipy"}),
        ("import wavesim.case.problem", (), {*HEAVY, "h5py", "rich"}),
        ("import wavesim as ws; ws.planewave; ws.Medium; ws.Bar", (), {*HEAVY, "h5py"}),
        ("import wavesim.io.result_writer", (), HEAVY),
        (COMMAND, ("--help",), {*HEAVY, "numpy", "h5py", "pydantic"}),
        (COMMAND, ("check", "cases/bandgap_pulse.toml"), {*HEAVY, "h5py"}),
        (COMMAND, ("bands", "cases/isotropic.toml", "--json"), {*HEAVY, "h5py"}),
    ],
    ids=["wavesim", "problem", "names", "storage", "help", "check", "bands"],
)
def test_light_things_load_nothing_heavy(program, arguments, absent):
    arguments = [str(PACKAGE.parent / a) if a.endswith(".toml") else a for a in arguments]
    found = loaded(program, *arguments)
    assert "wavesim" in found
    assert not found & absent


def test_names_of_the_package_lead_somewhere():
    import wavesim

    for name in wavesim.__all__:
        assert getattr(wavesim, name) is not None
    with pytest.raises(AttributeError, match="no attribute 'Nothing'"):
        wavesim.Nothing  # noqa: B018

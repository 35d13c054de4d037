"""Rooms and who leans on whom: imports run one way. Read off the modules' text, not off a run."""

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "wavesim"
MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in sorted(PACKAGE.rglob("*.py"))
}
# Each room leans on rooms of the floors below it; on one of its own floor if that does not lean
# back.
FLOORS = (
    {"material", "worker"},
    {"grid", "planewave", "sources"},
    {"layered", "differentiable"},
    {"simulation"},
    {"case", "timedomain", "io"},
    {"records"},
    {"readings"},
    {"studies", "verdict"},
    {"figures"},
    {"report", "paper"},
    {"runner"},
    {"cli"},
)
FLOOR = {room: number for number, rooms in enumerate(FLOORS) for room in sorted(rooms)}
JAX = {"jax", "diffrax", "equinox"}


@cache
def imports(name):
    """What a module imports, anywhere in its text: (modules of wavesim, other packages)."""
    own, others = set(), set()
    for node in ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{name}: relative import"
            inside = [f"{node.module}.{alias.name}" for alias in node.names]
            found = [full if full in MODULES else node.module for full in inside]
        else:
            continue
        for full in found:
            if full.partition(".")[0] == "wavesim":
                own.add(full)
            else:
                others.add(full.partition(".")[0])
    return own & set(MODULES) - {name}, others


@cache
def reached(name):
    """All modules of wavesim that one leans on, directly or not."""
    found, left = set(), [name]
    while left:
        new = imports(left.pop())[0] - found
        found |= new
        left += new
    return found


def room(name):
    """wavesim.grid.bar is of the room grid."""
    return name.split(".")[1] if "." in name else ""


def modules(*rooms):
    """Names of all modules of some rooms."""
    return [name for name in MODULES if room(name) in rooms]


@cache
def below(name):
    """Rooms that a room leans on."""
    return {room(other) for one in modules(name) for other in imports(one)[0]} - {name, ""}


def importers(*packages):
    """Rooms that import one of some packages."""
    return {room(name) for name in MODULES if set(packages) & imports(name)[1]}


def test_the_package_is_read():
    assert len(MODULES) > 60
    assert "timedomain" in below("runner")
    assert "wavesim.material.medium" in reached("wavesim.runner")
    assert "timedomain" in importers("jax")


def test_there_are_few_rooms_and_each_has_its_floor():
    """At most twenty at the top, files and folders counted alike."""
    top = {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or path.is_dir()}
    top -= {"__init__", "__main__", "__pycache__"}  # its front doors
    assert len(top) <= 20
    assert top == set(FLOOR)
    # The front of the package names modules in text alone.
    assert imports("wavesim")[0] == set()


@pytest.mark.parametrize("name", FLOOR)
def test_no_import_goes_up(name):
    above = [other for other in below(name) if FLOOR[other] > FLOOR[name]]
    assert above == []


def test_rooms_make_no_circle_and_at_most_ten_levels():
    levels = {}

    def level(name, on_the_way=()):
        assert name not in on_the_way, " → ".join([*on_the_way, name])
        if name not in levels:
            way = (*on_the_way, name)
            levels[name] = 1 + max((level(other, way) for other in below(name)), default=0)
        return levels[name]

    assert max(level(name) for name in FLOOR) <= 10


def test_no_module_leans_on_itself():
    assert [name for name in MODULES if name in reached(name)] == []


@pytest.mark.parametrize("side", ["planewave", "layered"])
def test_exact_solvers_know_no_grid_and_no_time(side):
    """Verdicts are worth something because the two routes share the material alone, and no jax."""
    judges = ["wavesim.paper.claims"] if side == "planewave" else []
    for name in modules(side) + judges:
        rooms = {room(other) for other in reached(name)} - {"paper"}
        assert rooms <= {"material", "sources", "planewave", "layered"}, name
        assert not JAX & set().union(*(imports(other)[1] for other in {name, *reached(name)})), name


def test_time_domain_knows_no_exact_solver():
    """And the other way round: no dispersion relation, nor what the grid makes of one."""
    for name in modules("timedomain"):
        leans = {room(other) for other in imports(name)[0]}
        assert leans <= {"material", "grid", "sources", "simulation", "timedomain"}, name
        assert "modified_wavenumber" not in MODULES[name].read_text(encoding="utf-8"), name


def test_readings_of_waves_know_no_theory():
    """What is measured is measured; the theory enters in the verdict."""
    for name in MODULES:
        if name.startswith(("wavesim.readings.dispersion", "wavesim.readings.pulse")):
            leans = {room(other) for other in imports(name)[0]}
            assert leans <= {"material", "sources", "simulation", "records", "readings"}, name


@pytest.mark.parametrize(
    ("packages", "rooms"),
    [
        (("h5py",), {"io"}),
        (("matplotlib",), {"figures", "paper", "report"}),
        (("click", "rich"), {"cli", "report"}),
        (("zarr", "dask", "distributed"), {"studies"}),
        (("pydantic",), {"case"}),
        (("diffrax", "equinox"), {"timedomain"}),
        (("jax",), {"timedomain", "differentiable", "studies", "runner"}),
    ],
    ids=lambda given: " ".join(sorted(given)),
)
def test_a_package_is_known_to_few_rooms(packages, rooms):
    assert importers(*packages) <= rooms


def test_one_module_integrates():
    """diffrax.diffeqsolve is called in one place."""
    calls = {
        name
        for name, path in MODULES.items()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Attribute | ast.Name)
        and getattr(node, "attr", getattr(node, "id", "")) == "diffeqsolve"
    }
    assert len(calls) == 1
    assert {room(name) for name in calls} == {"timedomain"}


LIGHT = set(FLOOR) - {"timedomain", "differentiable", "studies", "runner", "cli"}


@pytest.mark.parametrize("name", sorted(LIGHT))
def test_light_rooms_lean_on_no_jax(name):
    """So that a case is checked, bands drawn and a record read at once: not even in a function."""
    for own in modules(name):
        for other in {own, *reached(own)}:
            assert not JAX & imports(other)[1], f"{own} through {other}"


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
CASE = str(ROOT / "cases" / "isotropic.toml")


@pytest.mark.parametrize(
    ("program", "arguments", "absent"),
    [
        ("import wavesim", (), {*HEAVY, "numpy", "scipy"}),
        ("import wavesim as ws; ws.load", (), {*HEAVY, "h5py", "rich"}),
        ("import wavesim as ws; ws.planewave; ws.Medium; ws.Bar", (), {*HEAVY, "h5py"}),
        ("import wavesim.paper.claims, wavesim.planewave.gap_map", (), {*HEAVY, "h5py"}),
        ("import wavesim.io.result_writer", (), HEAVY),
        (COMMAND, ("--help",), {*HEAVY, "numpy", "h5py", "pydantic"}),
        (COMMAND, ("check", CASE), {*HEAVY, "h5py"}),
        (COMMAND, ("bands", CASE, "--json"), {*HEAVY, "h5py"}),
    ],
    ids=["wavesim", "load", "names", "claims", "io", "help", "check", "bands"],
)
def test_light_things_load_nothing_heavy(program, arguments, absent):
    found = loaded(program, *arguments)
    assert "wavesim" in found
    assert not found & absent


def test_names_of_the_package_lead_somewhere():
    import wavesim

    for name in wavesim.__all__:
        assert getattr(wavesim, name) is not None
    assert set(dir(wavesim)) == {*wavesim.__all__, "__doc__", "__version__"}
    with pytest.raises(AttributeError, match="no attribute 'Nothing'"):
        wavesim.Nothing  # noqa: B018


@pytest.mark.parametrize("begun", ["import wavesim, jax", "import jax, wavesim"])
def test_numbers_given_to_jax_before_a_run_keep_their_digits(begun):
    """In single precision a difference quotient over 1e-6 of a medium would be off by a tenth."""
    told = "assert jax.numpy.asarray(0.3) + 1e-12 > 0.3 + 0.9e-12"
    subprocess.run([sys.executable, "-c", f"{begun}\n{told}"], check=True, timeout=60)

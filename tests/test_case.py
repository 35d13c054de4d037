"""The case file: what is wrong is told in one line, what is left out has a default."""

import copy
import dataclasses
import math
import tomllib

import numpy as np
import pytest
import tomli_w

from wavesim.case.load import build, load
from wavesim.case.schema import CaseError, CaseFile, parse, read
from wavesim.material.medium import Medium, families, medium_of
from wavesim.timedomain.time_step import time_step

BASE = {
    "bar": {"length": 0.032, "spacing": 1.25e-4},
    "sources": [{"field": "phi1", "position": 0.016, "peak_frequency": 6e5}],
    "receivers": [{"name": "near", "position": 0.02}],
    "time": {"duration": 4e-6},
}
TEXT = tomli_w.dumps(BASE)


def case_of(*overrides, text=TEXT):
    return build(parse(text, "my.toml", overrides), "my.toml")


def message_of(*overrides, text=TEXT):
    with pytest.raises(CaseError) as caught:
        case_of(*overrides, text=text)
    return str(caught.value)


def without(*path):
    tables = copy.deepcopy(BASE)
    inner = tables
    for key in path[:-1]:
        inner = inner[key]
    del inner[path[-1]]
    return tomli_w.dumps(tables)


# override, where, key and value as the file would spell them, remedy
BAD = [
    # unknown keys
    ("medium.anisotropi=0.2", "[medium] anisotropi = 0.2", "did you mean anisotropy?"),
    ("bar.lenght=1", "[bar] lenght = 1", "did you mean length?"),
    ("sources.0.positon=3", "[[sources]] number 1: positon = 3", "did you mean position?"),
    ("receivers.0.nam='a'", '[[receivers]] number 1: nam = "a"', "did you mean name?"),
    ("time.zzz=1", "[time] zzz = 1", "known are duration, solver, step, samples"),
    ("mediun.anisotropy=0.2", "[mediun]: unknown table", "did you mean medium?"),
    ("plot.colour='red'", "[plot]: unknown table", "known are title, medium, bar, layers, sources"),
    ("order=10", "order = 10", "unknown key"),
    # wrong types
    ("title=3", "title = 3", "text in quotes"),
    ("medium=3", "medium = 3", "a table, [medium]"),
    ("sources=3", "sources = 3", "an array of tables"),
    ("sources.0=3", "[[sources]] number 1: 3", "a table, [[sources]]"),
    ("medium.anisotropy=true", "[medium] anisotropy = true", "a number"),
    ("medium.anisotropy='0.2'", '[medium] anisotropy = "0.2"', "a number"),
    ("bar.spacing='fine'", '[bar] spacing = "fine"', "a number"),
    ("bar.order=8.0", "[bar] order = 8.0", "a whole number"),
    ("bar.order=true", "[bar] order = true", "a whole number"),
    ("sources.0.field=3", "[[sources]] number 1: field = 3", "text in quotes"),
    ("time.step='big'", '[time] step = "big"', 'a number, or "auto"'),
    ("time.step=true", "[time] step = true", 'a number, or "auto"'),
    ("time.samples='many'", '[time] samples = "many"', 'a whole number, or "auto"'),
    ("time.samples=10.5", "[time] samples = 10.5", 'a whole number, or "auto"'),
    # words
    ("medium.closure='other'", '[medium] closure = "other"', '"printed" or "consistent"'),
    ("medium.closure='appendix_c'", '[medium] closure = "appendix_c"', '"printed" or'),
    ("medium.closure=true", "[medium] closure = true", '"printed" or "consistent"'),
    ("time.solver='rk4'", "[time] solver = 'rk4'", "one of auto, propagator, chebyshev"),
    ("sources.0.kind='sine'", '[[sources]] number 1: kind = "sine"', '"ricker"'),
    ("sources.0.field='phi4'", '[[sources]] number 1: field = "phi4"', "one of phi1, phi2"),
    # the medium's admissible ranges
    ("medium.anisotropy=2.5", "[medium] anisotropy = 2.5", "between -1 and 2"),
    ("medium.anisotropy=-1.5", "[medium] anisotropy = -1.5", "between -1 and 2"),
    ("medium.stiffness_ratio=-0.1", "[medium] stiffness_ratio = -0.1", "0 or greater"),
    ("medium.density=0", "[medium] density = 0", "greater than 0"),
    ("medium.G_n_g=-1", "[medium] G_n_g = -1", "0 or greater"),
    ("medium.rotation_inertia=0", "[medium] rotation_inertia = 0", "greater than 0"),
    ("medium.anisotropy=nan", "[medium] anisotropy = nan", "finite"),
    ("medium.branch_length=inf", "[medium] branch_length = inf", "finite"),
    ("medium.anisotropy=2.0", "[medium] anisotropy = 2 ", "or take closure 'consistent'"),
    # the bar
    ("bar.length=-0.1", "[bar] length = -0.1", "greater than 0"),
    ("bar.length=nan", "[bar] length = nan", "finite"),
    ("bar.length=inf", "[bar] length = inf", "finite"),
    ("bar.length=0.001", "[bar] cells = 8", "needs at least 16; lengthen the bar"),
    ("bar.cells=256", "[bar] length, cells: both", "one of the two"),
    ("bar.spacing=0", "[bar] spacing = 0", "greater than 0"),
    ("bar.order=3", "[bar] order = 3", "one of 2, 4, 6, 8, 10, 12"),
    ("bar.order=14", "[bar] order = 14", "one of 2, 4, 6, 8, 10, 12"),
    # the sources
    ("sources=[]", "sources = []", "at least one is needed"),
    ("sources.0.position=0.05", "[[sources]] number 1: position = 0.05", "0 to 0.032 m"),
    ("sources.0.position=-0.01", "[[sources]] number 1: position = -0.01", "0 or greater"),
    ("sources.0.position=nan", "[[sources]] number 1: position = nan", "finite"),
    ("sources.0.peak_frequency=5e7", "[[sources]] number 1: peak_frequency = 5e+07", "lower it"),
    ("sources.0.peak_frequency=0", "[[sources]] number 1: peak_frequency = 0", "greater than 0"),
    ("sources.0.peak_frequency=inf", "[[sources]] number 1: peak_frequency = inf", "finite"),
    ("sources.0.amplitude=0", "[[sources]] number 1: amplitude = 0", "nothing moves"),
    ("sources.0.amplitude=nan", "[[sources]] number 1: amplitude = nan", "finite"),
    ("sources.0.delay=nan", "[[sources]] number 1: delay = nan", "finite"),
    ("sources.0.width=-1", "[[sources]] number 1: width = -1", "0 or greater"),
    ("sources.0.width=0.003", "[[sources]] number 1: width = 0.003", "take at most"),
    # the receivers
    ("receivers.0.name=''", '[[receivers]] number 1: name = ""', "not blank"),
    ("receivers.0.name='a/b'", '[[receivers]] number 1: name = "a/b"', "without '/'"),
    ("receivers.0.name='..'", '[[receivers]] number 1: name = ".."', "not only dots"),
    ("receivers.0.position=1", "[[receivers]] number 1: position = 1", "0 to 0.032 m"),
    (
        "receivers=[{name='a',position=0.01},{name='a',position=0.02}]",
        '[[receivers]] name = "a"',
        "each receiver needs its own",
    ),
    # time
    ("time.duration=0", "[time] duration = 0", "greater than 0"),
    ("time.duration=-1", "[time] duration = -1", "greater than 0"),
    ("time.duration=nan", "[time] duration = nan", "finite"),
    ("time.step=0", "[time] step = 0", 'greater than 0, or "auto"'),
    ("time.step=inf", "[time] step = inf", "finite"),
    ("time.samples=1", "[time] samples = 1", "2 or greater"),
    # analysis
    ("analysis.k_min=-1", "[analysis] k_min = -1", "greater than 0"),
    ("analysis.k_min=5000", "[analysis] k_min = 5000", "below k_max"),
    ("analysis.k_max=10", "[analysis] k_min = 125.664", "below k_max = 10"),
    ("analysis.k_max=1e9", "[analysis] k_max = 1e+09", "finer [bar] spacing"),
    ("analysis.k_max=250", "[analysis] k_max = 250", "raise k_max, or lengthen the bar"),
    ("analysis.frequencies=3", "[analysis] frequencies = 3", "8 or greater"),
    ("analysis.damping=50", "[analysis] damping = 50", "30 or less"),
    ("analysis.bands=[{from=1e5,to=9e4}]", "[[analysis.bands]] number 1:", "greater than from"),
    ("analysis.bands=[{from='300kHz',to=9e5}]", "in Hz", "300000.0"),
    ("analysis.bands=[{from=1e5,to=9e5}]", "number 1: from = 100000", "between half-spaces"),
    ("analysis.damping=nan", "[analysis] damping = nan", "finite"),
]


@pytest.mark.parametrize(("override", "given", "remedy"), BAD, ids=[row[0] for row in BAD])
def test_bad_value_is_told_in_one_line(override, given, remedy):
    message = message_of(override)
    assert message.startswith("my.toml: ")
    assert "\n" not in message
    assert given in message
    assert remedy in message.partition(given)[2]
    assert len(message) < 330


@pytest.mark.parametrize(
    ("path", "told"),
    [
        (("bar",), "[bar]: required"),
        (("sources",), "[[sources]]: required"),
        (("time",), "[time]: required"),
        (("time", "duration"), "[time] duration: required"),
        (("bar", "length"), "[bar] length, cells: neither is given; give length (m) or cells"),
        (("sources", 0, "field"), "[[sources]] number 1: field: required"),
        (("sources", 0, "position"), "[[sources]] number 1: position: required"),
        (("sources", 0, "peak_frequency"), "[[sources]] number 1: peak_frequency: required"),
        (("receivers", 0, "name"), "[[receivers]] number 1: name: required"),
    ],
    ids=str,
)
def test_what_is_missing_is_named(path, told):
    message = message_of(text=without(*path))
    assert message.startswith(f"my.toml: {told}")
    assert "\n" not in message


def test_unknown_key_is_told_before_the_one_it_stands_for():
    text = TEXT.replace("duration", "durration")
    assert "[time] durration = 4e-06: unknown key; did you mean duration?" in message_of(text=text)


@pytest.mark.parametrize(
    ("override", "remedy"),
    [
        ("bar.order", "must be table.key=value"),
        ("=3", "must be table.key=value"),
        ("bar.=3", "must be table.key=value"),
        ("bar..order=3", "must be table.key=value"),
        ("sources.1.field='phi1'", "entries 0 to 0, not '1'"),
        ("sources.-1.field='phi1'", "entries 0 to 0, not '-1'"),
        ("sources.first.field='phi1'", "entries 0 to 0, not 'first'"),
        ("bar.length.x=3", "bar.length is a value and has no keys"),
        ("bar.order=10\nbar.cells=3", "one line"),
    ],
)
def test_bad_override_is_told_as_such(override, remedy):
    message = message_of(override)
    assert message.startswith("--set ")
    assert "\n" not in message
    assert remedy in message


def test_index_into_an_array_that_is_not_there():
    message = message_of("receivers.0.name='a'", text=without("receivers"))
    assert message.startswith("my.toml: receivers = ")
    assert message.endswith("must be an array of tables, [[receivers]]")


@pytest.mark.parametrize("key", ["duration=1e6", "samples=100000000000"])
def test_a_run_that_no_machine_holds_is_refused_before_it_begins(key):
    """A case may be looked at whatever its size; stepping it is refused, and it says why."""
    simulation = case_of(f"time.{key}").simulation
    with pytest.raises(
        ValueError, match=r"^(duration = 1e\+06|samples = 1000.*): .*; lower it, or"
    ):
        time_step(simulation)


def test_peak_frequency_limit_and_remedy_hold():
    """The frequency told as carried is carried, and so is the first one on the spacing told."""
    message = message_of("sources.0.peak_frequency=2e7")
    highest = float(message.split("at most ")[1].split(" Hz")[0])
    spacing = float(message.split("spacing ≤ ")[1])
    case_of(f"sources.0.peak_frequency={0.999 * highest:.6e}")
    cells = math.ceil(0.032 / spacing) + 2
    case_of("sources.0.peak_frequency=2e7", f"bar.spacing={0.032 / cells!r}")


def test_not_a_file_not_text_and_not_toml(tmp_path):
    for path, told in (
        (tmp_path / "absent.toml", "no such file"),
        (tmp_path, "is a folder, no regular file; name a case file"),
    ):
        with pytest.raises(CaseError, match=told) as caught:
            read(path)
        assert str(caught.value).startswith(f"{path}: ")
        assert "\n" not in str(caught.value)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(CaseError, match="not text in UTF-8"):
        read(binary)
    for broken in ("[medium\n", "a = \n", 'title = "x\n', "[bar]\n[bar]\n"):
        message = message_of(text=broken)
        assert message.startswith("my.toml: not valid TOML: ")
        assert "line" in message
        assert "\n" not in message


def test_defaults():
    """What a case may leave out is Table 1 of the paper and the design's own choices."""
    case = case_of()
    made = case.simulation
    assert made.medium == Medium()
    assert (made.medium.closure, made.medium.anisotropy, made.medium.stiffness_ratio) == (
        "printed",
        0.0,
        0.5,
    )
    assert (made.bar.cells, made.bar.spacing, made.bar.order) == (256, 1.25e-4, 8)
    assert (made.solver, made.step, made.receivers) == ("auto", None, {"near": 0.02})
    (source,) = made.sources
    assert (source.amplitude, source.width, source.peak_time) == (1.0, 0.0, 2 / 6e5)
    assert case.k_range == pytest.approx((0.02 * 2e3 * np.pi, 0.5 * 2e3 * np.pi), rel=1e-15)
    # Twice the band of 2.5 peak frequencies: an interval of 1/(2 · 2 · 2.5 f_p).
    assert made.interval <= 1 / (10 * 6e5)
    assert case_of("bar.spacing=2.5e-4").simulation.bar.cells == 128
    no_spacing = copy.deepcopy(BASE)
    del no_spacing["bar"]["spacing"]
    coarse = case_of("medium.branch_length=2e-3", text=tomli_w.dumps(no_spacing))
    assert coarse.simulation.bar.spacing == 2.5e-4


def test_whole_numbers_do_for_numbers():
    assert case_of("medium.anisotropy=1").simulation.medium.anisotropy == 1.0


def test_overrides_are_laid_over_in_order():
    case = case_of(
        "bar.order=10",
        "bar.order=12",
        "sources.0.field='phi2'",
        "sources.0.width = 2e-4",
        "medium.closure=consistent",
        "title=A bar",
        "time.samples=33",
    )
    made = case.simulation
    assert made.bar.order == 12
    assert (made.sources[0].field, made.sources[0].width) == ("phi2", 2e-4)
    assert made.medium.closure == "consistent"
    assert case.title == "A bar"
    assert made.frames == 33


def test_a_length_is_rounded_to_whole_cells_and_said():
    case = case_of("bar.length=0.0321")
    assert (case.simulation.bar.cells, case.simulation.bar.length) == (257, 257 * 1.25e-4)
    (note,) = case.notes
    assert "[bar] length = 0.0321" in note
    assert "257 cells, 0.032125 m" in note
    assert case_of().notes == ()


def test_a_receiver_at_a_rounded_end_stands_at_the_end():
    text = TEXT.replace("length = 0.032", 'length = 0.03205\nleft = "free"\nright = "free"')
    case = case_of("receivers.0.position=0.03205", text=text)
    assert case.simulation.receivers["near"] == case.simulation.bar.length == pytest.approx(0.032)


def test_a_width_below_a_cell_is_a_point_and_said():
    case = case_of("sources.0.width=1e-4")
    assert case.simulation.sources[0].width == 0
    (note,) = case.notes
    assert "[[sources]] number 1: width = 0.0001" in note
    # What is written of it is what was run.
    again = parse(case.resolved("propagator", 1e-7), "resolved.toml")
    assert again.sources[0].width == 0


def meaning(simulation):
    """A simulation without the difference between what is given and what stands for None."""
    layers = simulation.layers.mapped(
        lambda medium: dataclasses.replace(medium, **medium.parameters)
    )
    sources = tuple(dataclasses.replace(s, delay=s.peak_time) for s in simulation.sources)
    return dataclasses.replace(simulation, layers=layers, sources=sources)


@pytest.mark.parametrize("samples", ["auto", 2])
@pytest.mark.parametrize("solver", ["auto", "propagator", "chebyshev", "Dopri8"])
def test_resolved_case_repeats_itself(solver, samples):
    """The resolved text makes the same simulation and the same text: a fixed point."""
    taken, step = "chebyshev" if solver == "auto" else solver, 1.5e-8
    first = case_of(
        f"time.solver='{solver}'",
        f"time.samples={samples}",
        "medium.anisotropy=0.3",
        "medium.density=1571.5",
        "sources.0.width=1.3e-4",
    )
    text = first.resolved(taken, step)
    again = case_of(text=text)
    settled = dataclasses.replace(
        first.simulation, solver=taken, step=step, samples=first.simulation.frames
    )
    assert meaning(again.simulation) == meaning(settled)
    assert again.k_range == first.k_range
    assert again.resolved(taken, step) == text


def test_resolved_case_leaves_nothing_to_default():
    tables = tomllib.loads(case_of().resolved("chebyshev", 1e-7))
    of_a_run = {key: kind for key, kind in CaseFile.model_fields.items() if key != "design"}
    assert set(tables) == set(of_a_run)
    for name, model in of_a_run.items():
        fields = getattr(model.annotation, "model_fields", None)
        if fields is not None:
            # None stands for nothing here: a lossless medium, no absorbing end.
            absent = {"length", "absorber", "quality_factor", "quality_band"}
            others = [medium_of(one).declared() for one in families() if one != "rotation"]
            absent |= {key for known in others for key in known} - set(
                medium_of("rotation").declared()
            )
            assert set(tables[name]) == set(fields) - absent
    assert tables["bar"]["cells"] == 256


def test_load_names_the_file(tmp_path):
    path = tmp_path / "bar.toml"
    path.write_text(TEXT)
    assert load(path) == case_of()
    with pytest.raises(CaseError) as caught:
        load(path, ["bar.order=3"])
    assert str(caught.value).startswith(f"{path}: [bar] order = 3")

"""The commands: what they print, what they return, and that nobody ever meets a traceback."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import click
import numpy as np
import pytest
from runs import call

from wavesim import planewave, runner
from wavesim.cli import main as cli
from wavesim.cli.arguments import Quantity
from wavesim.cli.main import main
from wavesim.io.result_reader import describe
from wavesim.material.granular_equations import ROTATION
from wavesim.material.medium import Medium
from wavesim.report import terminal
from wavesim.timedomain import integrate, time_step


def wavesim(*arguments, **options):
    """Run a command as a user does."""
    return subprocess.run(
        [sys.executable, "-m", "wavesim", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=120,
        **options,
    )


@pytest.fixture
def tiny(tmp_path):
    """A case whose record is too short to judge a branch; 256 cells, 48 frames."""
    path = tmp_path / "tiny.toml"
    path.write_text(
        "[bar]\nlength = 0.032\n"
        "[[sources]]\nfield = 'B23'\nposition = 0.016\npeak_frequency = 6e5\n"
        "[time]\nduration = 8e-6\n"
    )
    return path


def test_help_names_the_commands():
    result = call("--help")
    assert result.exit_code == 0
    for name in ("run", "check", "bands"):
        assert f"  {name} " in result.output
    assert all(line == line.rstrip() for line in result.output.splitlines())


@pytest.mark.parametrize("command", ["run", "check", "bands"])
@pytest.mark.parametrize(
    ("text", "told"),
    [
        (None, "no such file"),
        ("[medium\n", "not valid TOML"),
        ("[medium]\nclosure = 'other'\n", 'must be "printed" or "consistent"'),
        ("[bar]\nlenght = 1.0\n", "did you mean length?"),
    ],
    ids=["absent", "broken", "word", "misspelt"],
)
def test_bad_input_gives_2_and_one_line(command, text, told, tmp_path):
    path = tmp_path / "case.toml"
    if text is not None:
        path.write_text(text)
    result = call(command, path)
    assert result.exit_code == 2
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"wavesim: {path}: ")
    assert told in line


def test_override_is_laid_over(tiny):
    result = call("check", tiny, "--set", "bar.order=3")
    assert result.exit_code == 2
    assert "[bar] order = 3: must be one of 2, 4" in result.stderr


def test_run_that_passes_gives_0(small_run):
    """The terminal, 80 columns of it: what was found, then the verdict, then where the page is."""
    assert (small_run.exit_code, small_run.stderr) == (0, "")
    assert small_run.summary["passed"]
    lines = small_run.stdout.splitlines()
    count = len(small_run.summary["checks"])
    verdict = next(n for n, line in enumerate(lines) if f"{count} of {count} checks" in line)
    for gap in small_run.summary["answers"]["gaps"]:
        at = next(n for n, line in enumerate(lines) if gap["gap"] in line)
        assert at < verdict
        assert f"{gap['lower'] / 1e3:.6g}" in lines[at]
        assert f"{gap['upper'] / 1e3:.6g}" in lines[at]
    assert all(len(line) <= 80 for line in lines[:verdict])
    assert lines[-1] == f"The page: {small_run.folder / 'report.html'}"
    told = " ".join(line.strip() for line in lines[verdict + 1 : -1])
    # Its conventions read speeds of several waves: which stands in place of a velocity.
    assert told.startswith(
        "Note: no pulse velocity between receivers of phi1: it is one of several"
    )
    assert told.count("Note") == 1


def test_quiet_run_prints_nothing_and_goes_to_outputs(small_case, small_run, monkeypatch):
    """Without --out the results go to outputs/ and the case's name."""
    asked = []

    def run(problem, folder, *rest):
        asked.append(folder)
        return runner.Outcome(small_run.summary, folder, [])

    monkeypatch.setattr(runner, "run", run)
    result = call("run", small_case, "--quiet")
    assert (result.exit_code, result.output) == (0, "")
    assert asked == [Path("outputs") / "small"]


def test_run_whose_check_falls_short_gives_1(tiny, tmp_path):
    """Differences of order 2 on four cells to a branch length are off by 3e-3 of a frequency."""
    out = tmp_path / "out"
    coarse = "bar.order=2", "bar.spacing=2.5e-4", 'sources.0.field="phi1"', "time.duration=4e-5"
    result = call("run", tiny, "--out", out, *(word for one in coarse for word in ("--set", one)))
    assert result.exit_code == 1
    assert "FAIL" in result.stdout
    summary = json.loads((out / "summary.json").read_text())
    assert not summary["passed"]
    failed = [check for check in summary["checks"] if not check["passed"]]
    assert failed
    for check in failed:
        assert check["measured"] is None or (
            abs(check["measured"] - check["reference"]) > check["tolerance"]
        )


def test_note_says_what_the_record_is_too_short_for(tiny, tmp_path):
    result = call("run", tiny, "--out", tmp_path / "out", "--set", "time.duration=1e-6")
    assert result.exit_code == 0
    assert "no branch was judged: frequency bins of 1e+03 kHz" in " ".join(result.stdout.split())
    assert "so much more strongly" not in result.stdout
    assert "lengthen [time] duration for finer bins" in " ".join(result.stdout.split())
    assert "warning" in result.stderr
    assert "the B23 source acts until" in result.stderr


def test_amplitudes_whose_energy_no_double_holds_are_refused(tiny, tmp_path):
    """A moment of 1e300 makes an energy of 1e600; one of 1e100 has the verdict of one of 1."""
    out = tmp_path / "out"
    result = call("run", tiny, "--out", out, "--set", "sources.0.amplitude=1e300")
    assert result.exit_code == 2
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert "amplitude = 1e+300" in line
    assert not out.exists()
    worst = []
    for number, amplitude in enumerate(("1", "1e100")):
        out = tmp_path / str(number)
        longer = "--set", "time.duration=1.2e-5"
        assert call("run", tiny, "--out", out, *longer, "--set", f"sources.0.amplitude={amplitude}")
        checks = json.loads((out / "summary.json").read_text())["checks"]
        worst.append([check["measured"] for check in checks if "TSO" in check["name"]])
    assert worst[0] == pytest.approx(worst[1], rel=1e-6)
    assert len(worst[0]) > 2


def test_unstable_stepper_gives_3_and_says_what_to_change(tiny, tmp_path, monkeypatch):
    """Tsit5 at steps of 12 radians of the fastest mode, far beyond where it is stable."""
    monkeypatch.setitem(time_step.EXPLICIT, "Tsit5", (6, 12.0))
    changes = "time.solver='Tsit5'", "time.duration=4e-5", "sources.0.field='phi1'"
    given = [word for change in changes for word in ("--set", change)]
    result = call("run", tiny, "--out", tmp_path / "out", *given)
    assert result.exit_code == 3
    assert "shorten [time] step or take solver 'chebyshev'" in result.stderr
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize("command", ["run", "bands"])
def test_folder_that_can_not_be_written_gives_2(command, tiny, tmp_path):
    """A folder below a regular file: not even root can make it."""
    (tmp_path / "file").write_text("")
    out = tmp_path / "file" / "folder"
    result = call(command, tiny, "--out", out)
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert line.startswith(f"wavesim: --out {out}: can't be written: ")
    assert "name another folder" in line


def test_resume_of_nothing_gives_2_and_says_nothing_else(tiny, tmp_path):
    """Not even what is foreseen of the case, which warns of a duration that ends with its pulse."""
    change = "time.duration=1.5e-6"
    warned = call("check", tiny, "--set", change)
    assert "duration" in warned.stderr + warned.stdout
    assert warned.exit_code == 1
    result = call("run", tiny, "--set", change, "--out", tmp_path / "none", "--resume")
    assert result.exit_code == 2
    (line,) = result.stderr.splitlines()
    assert "no such file: nothing is stored" in line
    assert "without --resume" in line


def test_interrupt_before_anything_is_stored_offers_nothing(tiny, tmp_path, monkeypatch):
    def stream(*arguments):
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(integrate, "stream", stream)
    result = call("run", tiny, "--out", tmp_path / "out")
    assert result.exit_code == 130
    assert result.stderr.splitlines()[-1] == "wavesim: interrupted"


def test_no_option_takes_a_number_that_is_none():
    """Whatever the command: nan, inf and a word are refused in a line that names the option."""
    options = [
        (option, kind)
        for command in main.commands.values()
        for option in command.params
        for kind in getattr(option.type, "types", [option.type])
        if isinstance(kind, click.types.FloatParamType | Quantity)
    ]
    assert len(options) > 20
    for option, kind in options:
        for word in ("nan", "inf", "-inf", "fast"):
            with pytest.raises(click.BadParameter) as refused:
                kind.convert(word, option, None)
            assert option.opts[0] in refused.value.format_message()


def test_wrong_usage_gives_2():
    for arguments in (["run"], ["nothing"], ["run", "a.toml", "--loud"]):
        result = call(*arguments)
        assert result.exit_code == 2
        (line,) = result.stderr.splitlines()
        assert line.startswith("wavesim: ")
        assert "Usage: " in line


def test_check_warns_and_gives_1_where_frames_alias(tiny):
    """Fewer than two frames to the shortest period of the band (2.5 f_p) alias."""
    result = call("check", tiny, "--set", "time.samples=20")
    assert result.exit_code == 1
    (line,) = result.stderr.splitlines()
    needed = int(line.split("take at least ")[1])
    assert needed == np.ceil(2 * 2.5 * 6e5 * 8e-6) + 1
    assert call("check", tiny, "--set", f"time.samples={needed}").exit_code == 0


def test_bands_json_keeps_the_contract(tiny):
    result = wavesim("bands", tiny, "--json", "--set", "medium.anisotropy=0.25")
    assert (result.returncode, result.stderr) == (0, "")
    answer = json.loads(result.stdout)
    medium = Medium(anisotropy=0.25)
    assert answer["medium"]["anisotropy"] == 0.25
    assert answer["medium"]["closure"] == "printed"
    assert set(answer["sectors"]) == set(ROTATION.sectors)
    names = set()
    for sector, content in answer["sectors"].items():
        omega = np.array(content["omega"])
        assert omega.shape == (len(content["k"]), 3)
        assert (np.diff(omega, axis=1) >= 0).all()
        np.testing.assert_array_equal(omega, planewave.frequencies(medium, sector, content["k"]))
        for gap in content["gaps"]:
            assert gap["upper"] >= gap["lower"]
            names.add(gap["name"])
    assert names == {"RLB1", "RLB2", "RTB1", "RTB2", "RSB"}
    assert all(high > low for low, high in answer["full_gaps"])


def test_bands_writes_data_and_figure(tiny, tmp_path):
    result = call("bands", tiny, "--out", tmp_path / "bands")
    assert result.exit_code == 0
    assert "RSB" in result.stdout
    content = json.loads((tmp_path / "bands" / "bands.json").read_text())
    assert set(content["sectors"]) == set(ROTATION.sectors)
    assert (tmp_path / "bands" / "bands.png").read_bytes()[1:4] == b"PNG"


def test_exit_codes_are_the_contract():
    assert (cli.FELL_SHORT, cli.BAD_INPUT, terminal.FAILED) == (1, 2, 3)
    assert isinstance(main, click.Group)


COMMAND = "import sys; sys.argv[0] = 'wavesim'; from wavesim.cli.main import entry; entry()"


def begun(*words, **options):
    """The command itself, as a process."""
    return subprocess.Popen(
        [sys.executable, "-c", COMMAND, *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"JAX_PLATFORMS": "cpu"},
        **options,
    )


def listens(process):
    """Whether a process catches SIGTERM, or has ended."""
    if process.poll() is not None:
        return True
    status = Path(f"/proc/{process.pid}/status").read_text()
    (caught,) = (line.split()[1] for line in status.splitlines() if line.startswith("SigCgt"))
    return bool(int(caught, 16) >> (signal.SIGTERM - 1) & 1)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_at_once(small_case, tmp_path, number):
    """In the middle of its frames: 130, one line that says how to go on, and a file that opens."""
    long = ["--set", "time.duration=4e-3", "--set", "time.samples=40000"]
    process = begun("run", small_case, "--out", tmp_path / "o", *long)
    try:
        deadline = time.monotonic() + 60
        while not (tmp_path / "o" / "result.h5").exists() and time.monotonic() < deadline:
            time.sleep(0.02)
        process.send_signal(number)
        told = process.communicate(timeout=10)[1]
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 130
    assert told.splitlines()[-1].startswith("wavesim: interrupted")
    assert "Traceback" not in told
    assert describe(tmp_path / "o" / "result.h5").status == "running"


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="/proc tells who listens")
@pytest.mark.parametrize("words", [("check",), ("run",), ("bands",)])
def test_a_signal_while_it_starts_ends_any_command(small_case, tmp_path, words):
    """From the moment on at which it listens to signals, before it has loaded anything else."""
    for later in (0.0, 0.25):
        process = begun(*words, small_case, cwd=tmp_path)
        while not listens(process):
            time.sleep(0.005)
        time.sleep(later)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=10)
        assert process.returncode in (0, 1, 130)
        assert "Traceback" not in out + err
        assert "resume" not in err

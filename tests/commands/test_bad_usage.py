"""Bad input on the command line: one line on stderr, exit 2, nothing started or written."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.commands.conftest import Command

NO_SUCH_NAME = "no such file, and no such scenario in the library; "
NO_SUCH_BUT = f"{NO_SUCH_NAME}closest: "
AGENTS = "qswarm: --agents: got 'many'; a whole number is needed (see qswarm sim --help)\n"
BAD = [
    ((), "Missing command"),
    (("fly",), "qswarm: No such command 'fly' (see qswarm --help)"),
    (("sim",), "Missing argument 'SCENARIO'"),
    (("sim", "none.toml"), "none.toml: no such file"),
    (("run", "none.toml"), "none.toml: no such file"),
    (("check", "none.toml"), "none.toml: no such file"),
    (("sim", "wegde-9"), f"wegde-9: {NO_SUCH_BUT}wedge-9, "),
    (("run", "wegde-9"), f"wegde-9: {NO_SUCH_BUT}wedge-9, "),
    (("check", "wegde-9"), f"wegde-9: {NO_SUCH_BUT}wedge-9, "),
    (("netem", "check", "wegde-9"), f"wegde-9: {NO_SUCH_BUT}wedge-9, "),
    (("sim", "%&"), f"%&: {NO_SUCH_NAME}"),
    (("sim", "wedge-9.toml"), "wedge-9.toml: no such file; the library has 'wedge-9'"),
    (("sim", "a/wedge-9.toml"), "a/wedge-9.toml: no such file; the library has 'wedge-9'"),
    (("sim", "."), ".: cannot be read: Is a directory"),
    (("sim", "small.toml", "--bogus"), "No such option: --bogus"),
    (("sim", "small.toml", "--agents", "many"), AGENTS),
    (("sim", "small.toml", "--agents", "0"), "small.toml: fleet.agents: got 0"),
    (("sim", "small.toml", "--agents", "3"), "small.toml: fleet.start.positions_m: 2 positions"),
    (("sim", "small.toml", "--seed", "-1"), "small.toml: seed: got -1"),
    (
        ("sim", "small.toml", "--duration", "nan"),
        "small.toml: duration_s: got nan; must be a finite number",
    ),
    (("sim", "small.toml", "--set", "netem.loss_percent"), "write it as netem.loss_percent=50"),
    (("sim", "small.toml", "--set", "=50"), "write it as netem.loss_percent=50"),
    (("sim", "small.toml", "--set", "netem.loss=50"), "netem.loss: unknown key"),
    (("sim", "small.toml", "--set", "control.controller=a:b"), "control.controller: 'a:b'"),
    (("sim", "small.toml", "--set", "vehicle.max_speed_mps=9"), "tick_hz = 90 is enough"),
    (("run", "small.toml", "--set", "vehicle.max_speed_mps=2"), "tick_hz = 40 is enough"),
    (("sim", "small.toml", "--seeds", "3"), "write first:end, as 0:20"),
    (("sim", "small.toml", "--seeds", "5:5"), "write first:end, as 0:20"),
    (("sim", "small.toml", "--seeds", "0:9999999"), "at most 1000000"),
    (("sim", "small.toml", "--seeds", "0:2", "--seed", "1"), "cannot be combined with --seed"),
    (("sim", "small.toml", "small.toml"), "small-seed1: would be written twice"),
    (("sim", "small.toml", "--jobs", "0"), "--jobs: got 0; at least 1 is needed"),
    (("run", "small.toml", "--speed", "0"), "--speed: got 0; at least 0.01 is needed"),
    (("run", "small.toml", "--speed", "inf"), "--speed"),
    (("run", "small.toml", "--speed", "2", "--lockstep"), "cannot be combined with --lockstep"),
    (("run", "small.toml", "--shards", "2"), "needs --lockstep"),
    (("run", "small.toml", "--on-overload", "stop"), "--on-overload: "),
    (
        ("run", "small.toml", "--on-overload", "slow", "--lockstep"),
        "--on-overload: cannot be combined with --lockstep, in which no tick is late",
    ),
    (("sim", "small.toml", "--out", "small.toml"), "small.toml: exists"),
    (("sim", "small.toml", "--out", "small.toml/x"), "cannot be created: not a directory"),
    (("run", "small.toml", "--out", "."), "exists; a run is never overwritten"),
    (("sim", "small.toml", "--seeds", "0:2", "--out", "."), "exists"),
    (("netem", "check", "small.toml", "--plot", "radio.txt"), "'radio.txt'; must end in .png"),
    (("verify", "none"), "none: no such"),
    (("ps", "none"), "none: no such folder"),
    (("ps", "."), ".: not a process run (no fleet.json)"),
    (("netem", "check", "a", "b"), "SCENARIO: got 2 scenarios; check takes one"),
    (("netem", "check"), "SCENARIO: got 0 scenarios; check takes one"),
    (("netem", "check", "small.toml", "--for", "3"), "--for: check changes nothing; omit it"),
    (("netem", "check", "small.toml", "--name", "x"), "--name: check changes nothing; omit it"),
    (("netem", "runs/mine", "show", "--for", "3"), "--for: show changes nothing; omit it"),
    (("fault", "x", "end", "a", "b"), "NAME: 'a b'; end takes the name of one fault"),
    (("bench", "--json", "nowhere/x.json"), "nowhere/x.json: cannot be written: no such folder"),
    (("bench", "--save", "nowhere/x.json"), "nowhere/x.json: cannot be written: no such folder"),
    (("bench", "--against", "none.json"), "none.json: no such file"),
    (("bench", "--against", "small.toml"), "small.toml: not JSON: "),
    (("bench", "--fail-over", "10"), "--fail-over: needs --against"),
    (
        ("bench", "--against", "x.json", "--fail-over", "inf"),
        "--fail-over: got inf; at most 1000000",
    ),
    (("bench", "--seconds", "10"), "--seconds: needs --processes"),
    (("bench", "--only", "Agent stop*"), "--only: no row matches 'Agent stop*'; a name as"),
    (("bench", "--only", "processes*"), "--only: 'processes*' needs --processes"),
    (
        ("bench", "--repeats", "1000"),
        "--repeats: got 1000; at most 100 is allowed (see qswarm bench",
    ),
]


@pytest.mark.parametrize(("arguments", "says"), BAD, ids=[" ".join(each) for each, _ in BAD])
def test_bad_input_is_one_line_and_exit_2(
    small: Path, qswarm: Command, arguments: tuple[str, ...], says: str
) -> None:
    printed = qswarm(*arguments)
    assert printed.status == 2
    assert printed.out == ""
    assert says in printed.err
    assert printed.err.count("\n") == 1
    assert list(small.parent.iterdir()) == [small]


def test_a_run_is_never_overwritten(small: Path, qswarm: Command) -> None:
    assert qswarm("sim", small, "--no-recording", "--out", "once").status == 0
    before = {file: file.read_bytes() for file in Path("once").iterdir() if file.is_file()}
    assert qswarm("sim", small, "--seed", "5", "--out", "once").status == 2
    assert {file: file.read_bytes() for file in before} == before


def test_the_process_itself_exits_2_with_one_line(small: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", MAIN, "check", "none.toml"],
        capture_output=True,
        text=True,
        check=False,
        env=ENVIRONMENT,
    )
    assert (done.returncode, done.stdout, done.stderr) == (2, "", "none.toml: no such file\n")


def test_a_reader_that_ends_early_causes_no_error_message(small: Path) -> None:
    started = subprocess.Popen(
        [sys.executable, "-c", MAIN, "check", str(small)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env=ENVIRONMENT,
    )
    with started:
        assert started.stdout is not None
        assert started.stderr is not None
        started.stdout.close()
        assert started.stderr.read() == b""
    assert started.returncode == 141


MAIN = "from worldsim.commands.app import main; main()"
ENVIRONMENT = {"PYTHONPATH": str(Path(__file__).parents[2])}

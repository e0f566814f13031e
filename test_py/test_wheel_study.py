"""Studies with `virtual_axes_py`: the rows of the sweep in this process on a Dask cluster, in files and in shards."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas
import pytest
from distributed import Client, LocalCluster
from optuna.trial import TrialState

import virtual_axes_py as va
from virtual_axes_py import chunks, cluster

pytestmark = pytest.mark.extended

BOUNDS = {
    f"{axis}.position_loop.gpc.{key}": bounds
    for axis in "xy"
    for key, bounds in {"n2": (8, 20), "nu": (1, 6), "lambda_rel": (0.01, 1.0)}.items()
}
VARIANTS = va.random_variants(5, 1000, BOUNDS)


@pytest.fixture(scope="module")
def machine() -> va.Machine:
    """Returns the default machine with predictive controllers."""
    machine = va.Machine.load()
    return machine.with_({f"{axis}.position_loop.controller": "gpc" for axis in machine.axes})


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    """Yields a client of two workers with one thread each."""
    options = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": "127.0.0.1:0", "host": "127.0.0.1"}
    with LocalCluster(**options) as local, Client(local) as one:
        yield one


@pytest.fixture(scope="module")
def expected(machine: va.Machine) -> va.SweepResults:
    """Returns the results in this process."""
    return va.sweep(machine, VARIANTS, va.scenario("ballbar"))


def assert_equal(found: pandas.DataFrame, expected: va.SweepResults) -> None:
    """Compares rows bit for bit; a column without any text has another type in a file."""
    table = expected.to_pandas()
    assert found["row"].to_list() == list(range(len(table)))
    found = found.drop(columns="row")
    assert list(found.columns) == list(table.columns)
    for name in table.columns:
        left, right = found[name].to_numpy(), table[name].to_numpy()
        assert ((left == right) | (pandas.isna(left) & pandas.isna(right))).all(), name


def test_a_cluster_and_files_have_the_rows_of_this_process(
    machine: va.Machine, client: Client, expected: va.SweepResults, tmp_path: Path
) -> None:
    found = va.sweep(machine, VARIANTS, va.scenario("ballbar"), executor=client)
    assert list(found) == list(expected)
    directory = va.sweep(machine, VARIANTS, va.scenario("ballbar"), executor=client, out=tmp_path / "study")
    assert_equal(va.merge(directory), expected)
    assert_equal(pandas.read_parquet(va.merge(directory, tmp_path / "all.parquet")), expected)


def test_variants_of_a_list_with_failures_are_equal_everywhere(
    machine: va.Machine, client: Client, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    variants = [{"x.position_loop.gpc.n2": n2} for n2 in range(-2, 20)] + [{"x.delays.alpha_ms": 6.0}, {}]
    psec = va.scenario("corner-90").psec(machine)
    here = va.sweep(machine, variants, psec, figures="contour")
    assert [result.error is not None for result in here].count(True) >= 3
    assert list(va.sweep(machine, variants, psec, figures="contour", executor=client, chunk=5)) == list(here)
    directory = va.sweep(machine, variants, psec, figures="contour", chunk=1, out=tmp_path / "study", progress=True)
    assert "\r24 of 24 variants, " in capsys.readouterr().err
    assert_equal(va.merge(directory), here)
    with pytest.raises(TypeError, match="x.position_loop.gain"):
        va.sweep(machine, [{"x.position_loop.gain": None}], psec, executor=client)


def test_chunks_of_a_killed_worker_come_once(machine: va.Machine, client: Client, expected: va.SweepResults) -> None:
    victim = next(iter(client.run(os.getpid).values()))
    setup = chunks.Setup(machine, va.scenario("ballbar"), "axes", 1)
    parts = [(first, min(first + 32, 1000)) for first in range(0, 1000, 32)]
    found: list[tuple[int, int]] = []
    results: dict[int, list[chunks.Outcome]] = {}
    for part, outcomes in cluster.run(client, chunks.simulate, setup, VARIANTS, parts):
        found.append(part)
        results[part[0]] = outcomes
        if len(found) == 4:
            os.kill(victim, signal.SIGKILL)
    assert sorted(found) == parts
    rows = [chunks.SweepResult.of(*one) for first, end in parts for one in zip(VARIANTS[first:end], results[first])]
    assert rows == list(expected)
    assert victim not in client.run(os.getpid).values()


DRIVER = """
import sys
sys.path.insert(0, {folder!r})
import virtual_axes_py as va
from distributed import Client
from test_wheel_study import VARIANTS
with Client({address!r}) as client:
    machine = va.Machine.from_yaml(open({machine!r}).read())
    va.sweep(machine, VARIANTS, va.scenario("ballbar"), executor=client, chunk=32, out={out!r})
"""


def test_a_killed_driver_is_resumed(
    machine: va.Machine, client: Client, expected: va.SweepResults, tmp_path: Path
) -> None:
    out, file = tmp_path / "study", tmp_path / "machine.yaml"
    file.write_text(machine.to_yaml())
    folder, address = str(Path(__file__).parent), client.scheduler.address
    program = DRIVER.format(folder=folder, address=address, machine=str(file), out=str(out))
    driver = subprocess.Popen([sys.executable, "-c", program])
    try:
        deadline = time.monotonic() + 60
        while len(list(out.glob("rows-*.parquet"))) < 3:
            assert time.monotonic() < deadline and driver.poll() is None
            time.sleep(0.005)
        driver.send_signal(signal.SIGKILL)
    finally:
        driver.kill()
        driver.wait(timeout=10)
    done = {path: path.stat().st_mtime_ns for path in out.glob("rows-*.parquet")}
    assert 3 <= len(done) < 32
    with pytest.raises(ValueError, match=r"rows \d+ to \d+ are missing"):
        va.merge(out)
    with pytest.raises(ValueError, match="resume=True"):
        va.sweep(machine, VARIANTS, va.scenario("ballbar"), out=out)
    # The rest runs elsewhere, and what is there is kept.
    va.sweep(machine, VARIANTS, va.scenario("ballbar"), out=out, resume=True)
    assert all(path.stat().st_mtime_ns == modified for path, modified in done.items())
    assert_equal(va.merge(out), expected)


def test_another_study_in_the_directory_is_named(machine: va.Machine, tmp_path: Path) -> None:
    out, still = tmp_path / "study", np.zeros((5, 5))
    variants = VARIANTS[:8]
    va.sweep(machine, variants, still, out=out, chunk=4)
    cases = [
        ("machine", (machine.with_({"x.position_loop.gain": 2.0}), variants, still, "axes")),
        ("motion", (machine, variants, np.zeros((6, 5)), "axes")),
        ("variants", (machine, va.random_variants(6, 8, BOUNDS), still, "axes")),
        ("variants, rows", (machine, VARIANTS[:9], still, "axes")),
        ("figures", (machine, variants, still, "contour")),
    ]
    for name, (other, rows, psec, figures) in cases:
        with pytest.raises(ValueError, match=f"another study: {name} differ"):
            va.sweep(other, rows, psec, figures=figures, out=out, resume=True)
    with pytest.raises(ValueError, match="another study: chunk differ"):
        va.sweep(machine, variants, still, out=out, chunk=2, resume=True)
    assert va.sweep(machine, variants, still, out=out, resume=True) == out


def test_shards_complete_each_other_and_a_merge_names_gaps_and_overlaps(
    machine: va.Machine, expected: va.SweepResults, tmp_path: Path
) -> None:
    out = tmp_path / "study"
    for index in (2, 0):
        va.sweep(machine, VARIANTS, va.scenario("ballbar"), out=out, shard=(index, 3), chunk=100)
    with pytest.raises(ValueError, match="rows 100 to 199 are missing"):
        va.merge(out)
    va.sweep(machine, VARIANTS, va.scenario("ballbar"), out=out, shard=(1, 3), chunk=100)
    assert_equal(va.merge(out), expected)
    one = out / "rows-000000100-000000200.parquet"
    (out / "rows-000000150-000000200.parquet").write_bytes(one.read_bytes())
    with pytest.raises(ValueError, match="rows-000000100-000000200.parquet and rows-000000150-.* overlap"):
        va.merge(out)
    (out / "rows-000000150-000000200.parquet").unlink()
    one.write_bytes(one.read_bytes()[:1000])
    with pytest.raises(ValueError, match="rows-000000100-000000200.parquet is damaged"):
        va.merge(out)


def test_random_variants_depend_on_seed_and_index_only() -> None:
    few, many = va.random_variants(1, 10, BOUNDS), va.random_variants(1, 10_000_000, BOUNDS)
    assert list(few) == list(many[:10]) and many[5_000_000:][2] == many[5_000_002]
    assert va.random_variants(2, 10, BOUNDS)[0] != few[0]
    drawn = [variant["x.position_loop.gpc.n2"] for variant in many[:2000]]
    assert set(drawn) == set(range(8, 21)) and all(isinstance(value, int) for value in drawn)
    weights = np.array([variant["y.position_loop.gpc.lambda_rel"] for variant in many[:2000]])
    assert weights.min() >= 0.01 and weights.max() <= 1.0 and abs(weights.mean() - 0.505) < 0.02


SEARCHED: dict[str, tuple] = {
    f"{axis}.position_loop.gpc.{key}": bounds
    for axis in "xy"
    for key, bounds in {"n2": (8, 20), "nu": (1, 8), "lambda_rel": (1e-3, 1.0, "log")}.items()
}


START = {key: {"n2": 14, "nu": 2, "lambda_rel": 0.05}[key.rsplit(".", 1)[1]] for key in SEARCHED}


def rms(machine: va.Machine) -> float:
    """Returns the RMS contour error of a machine on the ballbar, µm."""
    return machine.simulate(va.scenario("ballbar"), figures="contour").figures["contour_error_um"]["rms"]


def test_a_search_finds_a_better_machine_and_respects_margins(machine: va.Machine, client: Client) -> None:
    machine = machine.with_(START)
    free = va.optimize(machine, va.scenario("ballbar"), SEARCHED, "contour_error_um.rms", trials=128, seed=1)
    assert free.value == rms(free.machine) < rms(machine)
    first = free.study.trials[0]
    assert first.value == rms(machine) and first.params == START
    search = {"trials": 64, "seed": 1}
    here, there = (
        va.optimize(machine, va.scenario("ballbar"), SEARCHED, "contour_error_um.rms", executor=executor, **search)
        for executor in (None, client)
    )
    assert (here.value, here.changes) == (there.value, there.changes)
    limits = {"margin.modulus": (0.65, None), "axes.x.peak_current_a": (None, 40.0)}
    search = {"trials": 128, "seed": 1, "constraints": limits}
    safe = va.optimize(machine, va.scenario("ballbar"), SEARCHED, "contour_error_um.rms", **search)
    # Without the constraint the margin is smaller, so that it decides.
    assert modulus(free.machine) < 0.65 <= modulus(safe.machine)
    assert safe.value == rms(safe.machine) > free.value
    with pytest.raises(ValueError, match="none of 32 trials"):
        limits = {"margin.modulus": (0.99, None)}
        va.optimize(machine, va.scenario("x-constant"), SEARCHED, "duration_s", trials=32, constraints=limits)


def modulus(machine: va.Machine) -> float:
    """Returns the smaller modulus margin of X and Y."""
    design = va.design
    return min(design.margins(design.model(machine, axis), design.of_machine(machine, axis)).modulus for axis in "xy")


SEARCH = """
import os
import sys
import time
from pathlib import Path
sys.path.insert(0, {folder!r})
import virtual_axes_py as va
from test_wheel_study import SEARCHED
machine = va.Machine.from_yaml(open({machine!r}).read())
begun = Path({begun!r})

def cost(figures):
    # Neither search goes on before both have trials.
    (begun / str(os.getpid())).touch()
    end = time.monotonic() + 60
    while len(list(begun.iterdir())) < 2:
        assert time.monotonic() < end, "there is no other search"
        time.sleep(0.01)
    return figures["contour_error_um"]["rms"]

found = va.optimize(machine, va.scenario("corner-90"), SEARCHED, cost, trials=96, batch=8, storage={storage!r})
print(found.value)
"""


def test_two_processes_share_a_search(machine: va.Machine, tmp_path: Path) -> None:
    journal, file, begun = tmp_path / "journal", tmp_path / "machine.yaml", tmp_path / "begun"
    file.write_text(machine.to_yaml())
    begun.mkdir()
    folder = str(Path(__file__).parent)
    program = SEARCH.format(folder=folder, machine=str(file), storage=str(journal), begun=str(begun))
    searches = [subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) for _ in range(2)]
    try:
        values = [float(search.communicate(timeout=100)[0]) for search in searches]
    finally:
        for search in searches:
            search.kill()
            search.wait(timeout=10)
    records = [json.loads(line) for line in journal.read_text().splitlines()]
    finished = [record for record in records if record.get("state") in (TrialState.COMPLETE, TrialState.FAIL)]
    assert len({record["worker_id"] for record in finished}) == 2
    assert 96 <= len(finished) == len({record["trial_id"] for record in finished}) <= 96 + 8
    found = va.optimize(machine, va.scenario("corner-90"), SEARCHED, "contour_error_um.rms", trials=96, storage=journal)
    assert len(found.study.trials) == len(finished)
    assert found.value == min(values)
    others = {
        "motion": {"motion": va.scenario("x-constant")},
        "machine": {"machine": machine.with_({"x.velocity_loop.gain": 4.0})},
        "parameters": {"parameters": dict.fromkeys(SEARCHED, (1, 2))},
        "constraints": {"constraints": {"axes.x.peak_current_a": (None, 40.0)}},
        "objective": {"objective": "contour_error_um.max"},
    }
    given = {"machine": machine, "motion": va.scenario("corner-90"), "parameters": SEARCHED}
    for differing, changes in others.items():
        with pytest.raises(ValueError, match=f"another study 'study': {differing} differ"):
            va.optimize(**{**given, "objective": "contour_error_um.rms", **changes}, trials=96, storage=journal)


def test_an_unknown_parameter_of_random_variants_is_an_error(machine: va.Machine) -> None:
    variants = va.random_variants(seed=1, n=10, bounds={"x.position_loop.gian": (1.0, 2.0)})
    with pytest.raises(ValueError, match=r"unknown parameter x.position_loop.gian; the nearest is"):
        va.sweep(machine, variants, va.scenario("x-constant"))


def test_a_search_draws_numbers_of_the_kind_of_the_parameter(machine: va.Machine) -> None:
    """Whatever the kind of the bounds; bounds of a whole number must be whole."""
    gpc = machine.with_({"x.position_loop.controller": "gpc"})
    bounds = {"x.position_loop.gpc.n2": (12.0, 16.0), "x.feedforward.velocity": (0, 1)}
    found = va.optimize(gpc, va.scenario("x-constant"), bounds, "duration_s", trials=8, batch=8, seed=1)
    drawn = [trial.params for trial in found.study.trials]
    assert all(isinstance(one["x.position_loop.gpc.n2"], int) for one in drawn)
    assert any(0 < one["x.feedforward.velocity"] < 1 for one in drawn)
    with pytest.raises((TypeError, ValueError), match="n2, bound 12.5"):
        va.optimize(gpc, va.scenario("x-constant"), {"x.position_loop.gpc.n2": (12.5, 16)}, "duration_s", trials=1)


@pytest.mark.parametrize(
    ("parameters", "objective", "options", "text"),
    [
        (SEARCHED, "contour_error_um.mean", {}, "figure contour_error_um.mean is unknown; known are duration_s"),
        ({"x.foo": (0, 1)}, "duration_s", {}, "'x.foo' is unknown"),
        ({"x.position_loop.gain": (2.0, 1.0)}, "duration_s", {}, "lower one first"),
        ({"x.position_loop.gain": (0.0, 1.0, "log")}, "duration_s", {}, "x.position_loop.gain: bounds .* above 0"),
        (SEARCHED, "duration_s", {"constraints": {"margin.size": (0, None)}}, "margin.size: margins are modulus"),
        (SEARCHED, "duration_s", {"trials": 0}, "trials 0"),
    ],
)
def test_a_wrong_argument_of_a_search_is_named(
    parameters: dict, objective: str, options: dict, text: str, machine: va.Machine
) -> None:
    with pytest.raises(ValueError, match=text):
        va.optimize(machine, va.scenario("x-constant"), parameters, objective, **{"trials": 4, **options})


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"chunk": 0}, "chunk 0"),
        ({"resume": True}, "need a directory"),
        ({"shard": (2, 2), "out": "nowhere"}, "shard"),
    ],
)
def test_an_option_out_of_range_is_named(options: dict, text: str, machine: va.Machine) -> None:
    with pytest.raises(ValueError, match=text):
        va.sweep(machine, [{}], np.zeros((5, 5)), **options)
    with pytest.raises(ValueError, match="lower one first"):
        va.random_variants(0, 1, {"x.position_loop.gain": (2.0, 1.0)})


@pytest.mark.parametrize(
    ("package", "call", "extra"),
    [
        ("gymnasium", "import virtual_axes_py.gym", "gym"),
        ("distributed", "va.sweep(m, [{}], still, executor=object())", "dask"),
        ("pyarrow", "va.sweep(m, [{}], still, out='study')", "parquet"),
        ("optuna", "va.optimize(m, still, {'x.position_loop.gain': (1.0, 2.0)}, 'duration_s')", "optuna"),
    ],
)
def test_a_missing_package_is_named_with_its_extra(package: str, call: str, extra: str, tmp_path: Path) -> None:
    lines = [
        f"import sys; sys.modules[{package!r}] = None",
        "import numpy as np, virtual_axes_py as va",
        "m, still = va.Machine.load(), np.zeros((5, 5))",
        call,
    ]
    command = [sys.executable, "-c", "\n".join(lines)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=tmp_path)
    assert done.returncode == 1
    assert "ImportError: " in done.stderr and f"pip install 'virtual_axes_py[{extra}]'" in done.stderr


def test_the_programs_of_the_documentation_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (Path(__file__).resolve().parent.parent / "docs/how-to/studies.md").read_text(encoding="utf-8")
    programs = re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    assert len(programs) == 5
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("SLURM_ARRAY_TASK_ID", "0")
    monkeypatch.setenv("SLURM_ARRAY_TASK_COUNT", "1")
    # The cluster of the page runs in a program of its own.
    names: dict = {"__name__": "page"}
    for program in programs:
        for long, short in (("100_000", "64"), ("trials=320", "trials=32")):
            program = program.replace(long, short)
        exec(compile(program, "studies.md", "exec"), names)
    assert len(names["results"]) == len(names["table"]) == 64 and names["found"].changes

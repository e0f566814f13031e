"""Module `virtual_axes_py`: plots, controllers of one's own, systems of python-control, and forked processes."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import control
import numpy as np
import pytest
from matplotlib import pyplot as plt

import virtual_axes_py as va


@pytest.fixture(scope="module")
def machine() -> va.Machine:
    """Returns the default machine."""
    return va.Machine.load()


@pytest.fixture(scope="module")
def ballbar(machine: va.Machine) -> va.Run:
    """Returns a run of the ballbar test."""
    return machine.simulate(va.scenario("ballbar"))


@pytest.fixture(autouse=True)
def shown(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Rejects calls of `plt.show`, and closes the figures of each test."""
    calls: list[object] = []
    monkeypatch.setattr(plt, "show", lambda *args, **kwargs: calls.append(args))
    yield
    assert not calls
    plt.close("all")


def test_a_plot_has_units_and_belongs_to_pyplot(ballbar: va.Run) -> None:
    figure = ballbar.plot()
    assert plt.get_fignums() == [figure.number]
    position, error, current = figure.axes
    labels = ["setpoint and position, mm", "following error, µm", "motor current, A"]
    assert [panel.get_ylabel() for panel in figure.axes] == labels
    lines = {line.get_label(): line.get_ydata() for line in position.lines}
    assert list(lines) == ["x position", "x setpoint", "y position", "y setpoint"]
    assert lines["x position"] == pytest.approx(1e3 * ballbar.position[:, 0])
    assert lines["y setpoint"] == pytest.approx(1e3 * ballbar.psec[:, 1])
    assert error.lines[0].get_ydata() == pytest.approx(1e6 * ballbar.following_error[:, 0])
    assert current.lines[1].get_ydata() == pytest.approx(ballbar.current[:, 1])


def test_rotary_axes_have_panels_of_their_own(machine: va.Machine) -> None:
    run = machine.simulate(va.scenario("five-axis"))
    own, panels = plt.subplots(5)
    assert run.plot(ax=panels) is own and plt.get_fignums() == [own.number]
    assert panels[2].get_ylabel() == "setpoint and position, °"
    assert panels[2].lines[0].get_ydata() == pytest.approx(np.degrees(run.axis("a")["position"]))
    with pytest.raises(ValueError, match="ax has 2 axes of matplotlib; 5 are drawn: setpoint and position, mm"):
        run.plot(ax=panels[:2])
    assert len(run.plot(["c"]).axes) == 3
    with pytest.raises(ValueError, match="axis 'w' is unknown"):
        run.plot(["w"])


def test_a_path_is_colored_by_the_contour_error(ballbar: va.Run) -> None:
    own, panel = plt.subplots()
    assert ballbar.plot_path(ax=panel) is own
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("X, mm", "Y, mm")
    assert panel.lines[0].get_xydata() == pytest.approx(1e3 * ballbar.tool_setpoint[:, :2])
    (lines,) = panel.collections
    assert lines.get_array().max() == pytest.approx(ballbar.figures["contour_error_um"]["max"])
    assert ballbar.plot_path("xz").axes[0].get_ylabel() == "Z, mm"
    with pytest.raises(ValueError, match="plane 'uv': must be xy, yz or xz"):
        ballbar.plot_path("uv")


def test_the_path_of_a_program_shows_the_motions_at_feed(machine: va.Machine, tmp_path: Path) -> None:
    program = tmp_path / "corner.nc"
    program.write_text("G21 G90 G64 P0.05\nG0 Z-100\nG1 X20 F2000\nY10\nG0 Z0\nM2\n")
    run = machine.simulate(va.nc_program(program))
    panel, bar = run.plot_path().axes
    assert bar.get_ylabel() == "contour error from the polyline of setpoints, µm"
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("X, mm", "Y, mm")
    assert np.ptp(panel.get_xlim()) < 40
    _, rapids = panel.lines
    assert (rapids.get_label(), rapids.get_linestyle()) == ("rapid traverse", "--")
    (lines,) = panel.collections
    cuts = run.figures["part_program"]["contour_error_um"]["cuts"]
    assert lines.get_array().max() == pytest.approx(run.figures["contour_error_um"]["max"])
    assert f"contour error {cuts['max']:.6g} µm" in repr(run)
    # With the Z axis, rapid traverse is the longest.
    assert run.plot_path("xz").axes[0].get_ylabel() == "Z, mm"


def test_a_polar_plot_has_the_circular_deviation(ballbar: va.Run) -> None:
    figure = ballbar.plot_polar()
    figures = ballbar.figures["circles"]
    assert len(ballbar.circles()) == len(figures) > 0
    for line, expected in zip(figure.axes[0].lines, figures):
        deviation = line.get_ydata()
        assert deviation.max() == pytest.approx(expected["radial_deviation_um"]["max"], abs=1e-6)
        assert deviation.min() == pytest.approx(expected["radial_deviation_um"]["min"], abs=1e-6)
    figure.canvas.draw()
    numbers = [number.get_window_extent() for number in figure.axes[0].yaxis.get_ticklabels() if number.get_text()]
    assert len(numbers) > 2
    assert not any(inner.overlaps(outer) for inner, outer in zip(numbers, numbers[1:]))
    legend, chart = figure.axes[0].get_legend().get_window_extent(), figure.axes[0].get_window_extent()
    assert legend.y1 <= chart.y0
    with pytest.raises(ValueError, match="it must be polar"):
        ballbar.plot_polar(ax=plt.subplots()[1])


def test_a_bode_plot_has_the_frequency_response(machine: va.Machine) -> None:
    own, panels = plt.subplots(2)
    assert va.plot_bode(machine, "x", ax=panels) is own
    expected = va.design.frequency_response(machine, "x")
    assert np.array_equal(panels[0].lines[0].get_ydata(), expected.closed_db)
    assert np.array_equal(panels[1].lines[1].get_ydata(), expected.open_deg)
    assert [panel.get_ylabel() for panel in panels] == ["magnitude, dB", "phase, °"]
    assert len(va.plot_bode(machine).axes[0].lines) == 2 * len(machine.axes)
    assert len(expected.plot().axes) == 2


def test_a_controller_of_ones_own_has_the_bits_of_its_design(machine: va.Machine) -> None:
    gpc = machine.with_({"x.position_loop.controller": "gpc"})
    own = machine.with_controller("x", va.design.of_machine(gpc, "x"))
    assert own.parameters["x.position_loop.controller"] == "rst"
    assert va.design.of_machine(own, "x") == va.design.of_machine(gpc, "x")
    runs = [one.simulate(va.scenario("x-constant")) for one in (gpc, own, machine)]
    assert runs[1].position == pytest.approx(runs[0].position, abs=1e-12)
    assert np.abs(runs[2].position - runs[0].position).max() > 1e-5
    with pytest.raises(ValueError, match="axis 'w' is unknown"):
        machine.with_controller("w", va.design.of_machine(gpc, "x"))
    with pytest.raises(TypeError, match="rst is of type float"):
        machine.with_controller("x", 1.0)
    unstable = va.design.rst([1000.0], [1.0], [1000.0])
    with pytest.raises(ValueError, match="unstable"):
        machine.with_controller("x", unstable)
    assert machine.with_controller("x", unstable, allow_unstable=True)


def test_every_form_of_a_system_becomes_the_same_model(machine: va.Machine) -> None:
    model = va.design.model(machine, "x")
    system = va.design.to_control(model)
    zeros, poles = system.zeros(), system.poles()
    first = next(value for value in system.num[0][0] if value != 0)
    shifted = control.TransferFunction(system.num[0][0], system.den[0][0], True)
    states = va.design.from_control(control.ss([[0.5, 1.0], [0.0, 0.25]], [[0.0], [1.0]], [[2.0, 0.0]], [[0.0]], 0.006))
    # 2 / ((z − 0.5)(z − 0.25))
    assert (states.a, states.b, states.period) == (pytest.approx([1, -0.75, 0.125]), pytest.approx([0, 0, 2]), 0.006)
    forms = {
        "tf": va.design.from_control(system, period=machine.position_period),
        "zpk": va.design.from_control(control.zpk(zeros, poles, first, model.period)),
        "dt=True": va.design.from_control(shifted, period=model.period),
    }
    grid = np.exp(2j * np.pi * np.linspace(1, 80, 40) * model.period)
    for name, found in forms.items():
        response = va.design.to_control(found)(grid)
        assert response == pytest.approx(system(grid), rel=1e-6), name


@pytest.mark.parametrize(
    ("system", "options", "error", "text"),
    [
        (control.tf([1.0], [1.0, 1.0]), {}, ValueError, "must be discrete .*sample_system"),
        (control.tf([1.0], [1.0, -0.5], True), {}, ValueError, "give period"),
        (control.tf([1.0], [1.0, -0.5], 0.01), {"period": 0.006}, ValueError, "is 0.01 s; it must be 0.006 s"),
        (control.tf([1.0, 0.0, 0.0], [1.0, -0.5], 0.006), {}, ValueError, "2 zeros and 1 poles"),
        (
            control.tf([[[1.0], [2.0]], [[3.0], [4.0]]], [[[1.0, 0.5]] * 2] * 2, 0.006),
            {},
            ValueError,
            "2 inputs and 2 outputs; it must have one of each",
        ),
        (control.ss(np.eye(1), np.ones((1, 2)), np.ones((1, 1)), np.zeros((1, 2)), 0.006), {}, ValueError, "2 inputs"),
        (3.0, {}, TypeError, "system is of type float"),
    ],
)
def test_a_system_that_is_no_model_is_named(system: object, options: dict, error: type, text: str) -> None:
    with pytest.raises(error, match=text):
        va.design.from_control(system, **options)


FORK = """
import multiprocessing, os, sys, numpy as np, virtual_axes_py as va
machine, scenario = va.Machine.load(), va.scenario("corner-90")
def work():
    tuned = va.tune(machine, scenario, controller="contour").cost
    run = machine.simulate(va.scenario("x-there-and-back"))
    channels = {"time": run.time, **{name: run.axis("x")[name] for name in ("psec", "position", "current")}}
    va.identify(channels, "x", machine, refine=())
    return tuned
expected = work()
if sys.argv[1] == "os":
    child = os.fork()
    if child == 0:
        os._exit(0 if work() == expected else 3)
    sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
with multiprocessing.get_context("fork").Pool(2) as pool:
    sys.exit(0 if pool.apply(work) == expected else 3)
"""


@pytest.mark.parametrize("kind", ["os", "multiprocessing"])
def test_a_forked_child_computes_as_its_parent(kind: str) -> None:
    process = subprocess.Popen([sys.executable, "-W", "ignore", "-c", FORK, kind], start_new_session=True)
    try:
        assert process.wait(timeout=240) == 0
    finally:
        if process.poll() is None:
            os.killpg(process.pid, 9)
            process.wait(timeout=10)

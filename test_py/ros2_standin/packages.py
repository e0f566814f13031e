"""Verbs of installed packages: run and launch."""

from __future__ import annotations

import argparse
import os
import runpy
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from ament_index_python.packages import PackageNotFoundError, get_package_prefix
from graph import Failure


def _program(package: str, executable: str) -> Path:
    try:
        path = Path(get_package_prefix(package)) / "lib" / package / executable
    except PackageNotFoundError as error:
        raise Failure(f"Package '{package}' not found") from error
    if not os.access(path, os.X_OK):
        raise Failure("No executable found")
    return path


def run(arguments: argparse.Namespace) -> None:
    """Executes a program of a package."""
    path = _program(arguments.package, arguments.executable)
    os.execv(path, [str(path), *arguments.arguments])


class Programs(dict):
    """Programs of installed packages, by package and name."""

    def get(self, key: tuple[str, str], default: str | None = None) -> str | None:
        """Returns the path from the package index."""
        try:
            return str(_program(*key))
        except Failure:
            return default


def launch(arguments: argparse.Namespace) -> None:
    """Starts the nodes of a launch file; ends with the last of them."""
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "launch_standin"))
    from launch import run as execute
    from launch_ros import substitutions
    from launch_ros.actions import Node

    substitutions.PROGRAMS = Programs()
    try:
        share = Path(get_package_prefix(arguments.package)) / "share" / arguments.package
    except PackageNotFoundError as error:
        raise Failure(f"Package '{arguments.package}' not found, searching: {error}") from error
    found = next(share.glob(f"**/{arguments.file}"), None)
    if found is None:
        raise Failure(f"file '{arguments.file}' was not found in the share directory of package '{arguments.package}'")
    values = dict(argument.split(":=", 1) for argument in arguments.arguments)
    description = runpy.run_path(str(found))["generate_launch_description"]()
    print(
        "[INFO] [launch]: All log files can be found below "
        f"{Path.home()}/.ros/log/{time.strftime('%Y-%m-%d-%H-%M-%S')}-{os.getpid()}"
    )
    print("[INFO] [launch]: Default logging verbosity is set to INFO", flush=True)
    try:
        nodes = [action for action in execute(description, values) if isinstance(action, Node)]
    except Exception as error:
        raise Failure(f"[ERROR] [launch]: Caught exception in launch (see debug for traceback): {error}") from error
    processes, threads = [], []
    for number, node in enumerate(nodes, 1):
        label = f"{node.executable}-{number}"
        try:
            program = _program(node.package, node.executable)
        except Failure as failure:
            print(f"[INFO] [{label}]: not started by this stand-in: {failure}", flush=True)
            continue
        process = subprocess.Popen(
            [program, *node.command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        print(f"[INFO] [{label}]: process started with pid [{process.pid}]", flush=True)
        thread = threading.Thread(target=_forward, args=(process, label))
        thread.start()
        processes.append(process)
        threads.append(thread)
    _join(processes, threads)


def _forward(process: subprocess.Popen[str], label: str) -> None:
    """Prints the output of a process, each line with its label."""
    for line in process.stdout:
        print(f"[{label}] {line}", end="", flush=True)


def _join(processes: list[subprocess.Popen[str]], threads: list[threading.Thread]) -> None:
    """Waits for the processes; Ctrl+C or SIGTERM ends them first."""

    def end(*_: object) -> None:
        for process in processes:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)

    signal.signal(signal.SIGINT, end)
    signal.signal(signal.SIGTERM, end)
    for process, thread in zip(processes, threads):
        process.wait()
        thread.join()

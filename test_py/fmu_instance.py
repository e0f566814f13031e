"""FMUs that the command writes, and instances of them in FMPy."""

from __future__ import annotations

import subprocess
from pathlib import Path

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE

from node_process import node_binary

COMMAND = str(Path(node_binary()).with_name("virtual_axes"))
TSP = 0.006
TSI = 0.000125
"""Position and current cycle of the default machine, s."""


class Instance:
    """Instance of an FMU with the messages that it logs."""

    def __init__(self, fmu: Fmu, name: str = "axes") -> None:
        """Loads the library and instantiates."""
        self.references = fmu.references
        self.messages: list[str] = []
        self.callbacks = fmi2CallbackFunctions()
        self.callbacks.logger = fmi2CallbackLoggerTYPE(
            lambda env, name, status, category, message: self.messages.append(message.decode())
        )
        self.slave = FMU2Slave(
            guid=fmu.description.guid,
            unzipDirectory=str(fmu.folder),
            modelIdentifier=fmu.description.coSimulation.modelIdentifier,
            instanceName=name,
        )
        self.slave.instantiate(callbacks=self.callbacks)

    def initialize(self, start: float = 0.0, stop: float | None = None, **positions: float) -> None:
        """Initializes with start positions by axis; `stop` is the stop time, s."""
        self.slave.setupExperiment(startTime=start, stopTime=stop)
        self.slave.enterInitializationMode()
        for axis, position in positions.items():
            self.set(f"{axis}.start_position", position)
        self.slave.exitInitializationMode()

    def set(self, *pairs: str | float) -> None:
        """Sets real variables: name, value, name, value, …."""
        self.slave.setReal([self.references[str(name)] for name in pairs[::2]], pairs[1::2])

    def get(self, *names: str) -> list[float]:
        """Returns real variables."""
        return self.slave.getReal([self.references[name] for name in names])

    def close(self) -> None:
        """Frees the instance and the library."""
        self.slave.freeInstance()


class Fmu:
    """Extracted FMU with its model description."""

    def __init__(self, file: Path) -> None:
        """Extracts the archive beside it."""
        self.file = file
        self.folder = file.with_suffix("")
        extract(str(file), str(self.folder))
        self.description = read_model_description(str(file))
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}


def write_fmu(folder: Path, *arguments: str) -> Fmu:
    """Returns the FMU that the command writes."""
    file = folder / "axes.fmu"
    subprocess.run([COMMAND, "fmu", "--out", str(file), *arguments], check=True, timeout=60)
    return Fmu(file)

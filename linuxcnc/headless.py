#!/usr/bin/python3
"""User interface of LinuxCNC without a screen: homes, executes programs, logs commands and feedback.

    VIRTUAL_AXES_PROGRAMS=a.ngc:b.ngc VIRTUAL_AXES_LOG=log.csv linuxcnc mill.ini

The log has a row for each servo period since the drives were first enabled: the number of steps of the drives, then
command and feedback of each joint in mm or degrees, all digits of each. `VIRTUAL_AXES_RESULT` is a JSON file with the
programs that were completed and the messages of the control.
"""

import json
import os
import sys
import time

import hal
import linuxcnc

START_S = 60
PROGRAM_S = float(os.environ.get("VIRTUAL_AXES_PROGRAM_TIMEOUT_S", "120"))
SAMPLER_KEY = 0x48534130


class Log:
    """Rows of the HAL component sampler, written to a CSV file."""

    def __init__(self, path):
        self.component = hal.component("headless")
        self.component.ready()
        self.stream = hal.stream(self.component, SAMPLER_KEY)
        joints = len(self.stream.element_types) // 2
        self.file = open(path, "w")
        names = [f"joint.{joint}.motor-pos-{end}" for joint in range(joints) for end in ("cmd", "fb")]
        self.file.write(",".join(["steps", *names]) + "\n")
        self.last = None

    def drain(self):
        """Writes the rows so far; a row before the first step is kept until the step follows."""
        while (row := self.stream.read()) is not None:
            steps = row[-1]
            if steps == 1 and self.last and self.last[-1] == 0:
                self.write(self.last)
            if steps >= 1:
                self.write(row)
            self.last = row

    def write(self, row):
        """Writes a row."""
        self.file.write(",".join([str(row[-1]), *map(repr, row[:-1])]) + "\n")

    def close(self):
        """Writes the last rows."""
        self.drain()
        self.file.close()
        if self.stream.num_overruns:
            raise SystemExit(f"headless: {self.stream.num_overruns} rows of the log are lost")


class Control:
    """LinuxCNC's task, with bounded waits."""

    def __init__(self, log):
        self.log = log
        self.command = linuxcnc.command()
        self.status = linuxcnc.stat()
        self.errors = linuxcnc.error_channel()
        self.messages = []
        self.polls_at_rest = 0

    def poll(self):
        """Reads state, messages and log."""
        self.status.poll()
        while (message := self.errors.poll()) is not None:
            self.messages.append(message[1])
        if self.log:
            self.log.drain()

    def wait(self, what, condition, seconds):
        """Waits for a condition of the state; returns False if the control stops or reports first."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.poll()
            if condition():
                return True
            if self.messages and what != "machine on":
                return False
            time.sleep(0.01)
        self.messages.append(f"headless: no {what} within {seconds} s")
        return False

    def start(self):
        """Switches the machine on and homes it."""
        self.command.state(linuxcnc.STATE_ESTOP_RESET)
        self.command.wait_complete(10)
        self.command.state(linuxcnc.STATE_ON)
        self.command.wait_complete(10)
        if not self.wait("machine on", lambda: self.status.task_state == linuxcnc.STATE_ON, START_S):
            return False
        self.command.mode(linuxcnc.MODE_MANUAL)
        self.command.wait_complete(10)
        self.command.home(-1)
        joints = self.status.joints
        return self.wait("homing", lambda: all(self.status.homed[:joints]), START_S)

    def is_at_rest(self):
        """Returns true if no line of a program is left and the axes have arrived, for 20 polls on end."""
        at_rest = self.status.interp_state == linuxcnc.INTERP_IDLE and self.status.inpos and self.status.queue == 0
        self.polls_at_rest = self.polls_at_rest + 1 if at_rest else 0
        return self.polls_at_rest > 20

    def execute(self, program):
        """Executes a program to its end; returns True if it is complete."""
        self.polls_at_rest = 0
        self.command.mode(linuxcnc.MODE_AUTO)
        self.command.wait_complete(10)
        self.command.program_open(os.path.abspath(program))
        self.command.wait_complete(10)
        self.command.auto(linuxcnc.AUTO_RUN, 0)
        self.command.wait_complete(10)
        done = self.wait("end of the program", self.is_at_rest, PROGRAM_S)
        return done and self.status.task_state == linuxcnc.STATE_ON and not self.messages


def main():
    """Executes the programs and writes log and result."""
    programs = [path for path in os.environ.get("VIRTUAL_AXES_PROGRAMS", "").split(":") if path]
    path = os.environ.get("VIRTUAL_AXES_LOG")
    log = Log(path) if path else None
    control = Control(log)
    completed = []
    if control.start():
        for program in programs:
            if not control.execute(program):
                break
            completed.append(program)
    control.poll()
    # Before the drives are off, which ends position control.
    if log:
        log.close()
    control.command.state(linuxcnc.STATE_OFF)
    control.command.wait_complete(5)
    result = {"completed": completed, "messages": control.messages}
    if "VIRTUAL_AXES_RESULT" in os.environ:
        with open(os.environ["VIRTUAL_AXES_RESULT"], "w") as file:
            json.dump(result, file)
    print(json.dumps(result))
    return 0 if len(completed) == len(programs) else 1


if __name__ == "__main__":
    sys.exit(main())

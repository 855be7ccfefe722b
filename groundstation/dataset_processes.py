"""Plays one recording to a real onboard process in real time, on an emulated bus."""

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from config.fleet import Fleet
from config.loader import dump_effective
from config.messages import Message, Truth
from groundstation.dataset_fleet import Start, dataset_fleet, robot_name
from groundstation.dataset_play import PROGRESS_PERIOD_S, Played, Progress
from groundstation.errors import GroundError
from groundstation.fleet_link import POLL_S, FleetLink
from groundstation.lockstep import Recording
from groundstation.rehearsal import rehearsal
from groundstation.supervisor import Supervisor

PLAYER = "sim"
UP_LIMIT_S = 15.0


def play_processes(
    recording: Recording, start: Start, limit_s: float, out: Path, progress: Progress
) -> Played:
    """Play until the recording or `limit_s` is over; the processes' logs go to `out`.

    Raises GroundError where a process does not come up or ends early.
    """
    wanted = dataset_fleet({recording.robot: recording}, start, interface="simcan")
    with tempfile.TemporaryDirectory(prefix="echelon-") as runtime:
        fleet = rehearsal(wanted, Path(runtime)).fleet
        file = out / "fleet.yaml"
        file.write_text(dump_effective(fleet), encoding="utf-8")
        with FleetLink.as_ground_station(fleet) as link, Supervisor(out) as supervisor:
            return _Player(recording, fleet, file, link, supervisor).play(limit_s, progress)


class _Player:
    """One playback: bring the processes up, listen until it is over."""

    def __init__(
        self,
        recording: Recording,
        fleet: Fleet,
        file: Path,
        link: FleetLink,
        supervisor: Supervisor,
    ) -> None:
        self._recording, self._fleet, self._file = recording, fleet, file
        self._link, self._supervisor = link, supervisor
        self._name = robot_name(recording.robot)
        self._waiting: list[Message] = []
        self._started_s: float | None = None
        self._played = Played()

    def play(self, limit_s: float, progress: Progress) -> Played:
        """Everything that the robot says until the end."""
        folder, number = str(self._recording.path.resolve()), str(self._recording.robot)
        player = ["-m", "sim_hw.dataset", "--fleet", str(self._file), "--data", folder]
        self._start(PLAYER, [*player, "--robot", number])
        self._wait(lambda: PLAYER in self._link.view.alive, "the playback to serve the bus")
        self._start(
            self._name, ["-m", "onboard", "--fleet", str(self._file), "--robot", self._name]
        )
        self._wait(lambda: self._started_s is not None, f"{self._name} to be heard on its bus")
        end_s = min(limit_s, self._recording.end_s - self._recording.start_s)
        began_s, next_s = time.perf_counter(), 0.0
        while self._played.seconds < end_s:
            self._pump()
            time.sleep(POLL_S)
            if self._played.seconds >= next_s:
                next_s += PROGRESS_PERIOD_S
                progress(self._name, self._played.seconds)
        self._played.real_s = time.perf_counter() - began_s
        return self._played

    def _start(self, name: str, command: list[str]) -> None:
        self._supervisor.start(name, [sys.executable, *command])

    def _wait(self, reached: Callable[[], bool], what: str) -> None:
        deadline = time.monotonic() + UP_LIMIT_S
        while not reached():
            self._pump()
            time.sleep(POLL_S)
            if time.monotonic() > deadline:
                raise GroundError(f"waited {UP_LIMIT_S:g} s in vain for {what}")

    def _pump(self) -> None:
        """Take what has arrived. The player's truth is valid from the recording's start on."""
        if ended := self._supervisor.ended():
            raise GroundError(str(ended[0]))
        for heard in self._link.poll():
            message = heard.message
            if not isinstance(message, Truth):
                self._waiting.append(message)
            elif message.valid:
                if self._started_s is None:
                    self._started_s = message.t_ns * 1e-9
                self._played.seconds = message.t_ns * 1e-9 - self._started_s
        if self._started_s is not None:
            for message in self._waiting:
                t_s = message.t_ns * 1e-9 - self._started_s
                if t_s >= 0.0:
                    self._played.keep(t_s, message)
            self._waiting.clear()

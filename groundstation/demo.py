"""A whole run on one machine: simulated hardware, the robots' own program, record, judgement."""

import shutil
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from config.fault_script import load_faults
from config.faults import FaultScript
from config.fleet import Fleet
from groundstation import run_folder
from groundstation.conductor import Commands, Conductor
from groundstation.evaluate import evaluate
from groundstation.figures import draw_formation, draw_trajectories
from groundstation.fleet_link import FleetLink
from groundstation.progress import Display, display
from groundstation.recorder import About, Recorder
from groundstation.recovery import save_left_behind
from groundstation.rehearsal import rehearsal
from groundstation.run_folder import RunFolder
from groundstation.series import read_run
from groundstation.summary import Fault, Mode, Summary
from groundstation.supervisor import Supervisor
from groundstation.web.live import HandedSource, LinkCommands
from groundstation.web.server import Listen, PageServer

FAULTS = "faults.yaml"


@dataclass(frozen=True, slots=True)
class Options:
    """How to run a demo. `console` is where progress is told, `faults` a file of scripted ones."""

    fleet: Fleet
    seed: int
    lockstep: bool
    out: Path | None
    console: Console
    faults: Path | None = None


def run_demo(options: Options) -> tuple[RunFolder, Summary]:
    """Run, record, judge and draw one mission.

    Raises GroundError when the run cannot be set up. On KeyboardInterrupt the robots are stopped,
    the processes ended and the recording closed before it goes on.
    """
    script = _script(options)
    folder = run_folder.create(options.fleet.name, options.lockstep, options.out)
    options.console.print(
        f"run folder: {folder.path}", highlight=False, markup=False, soft_wrap=True
    )
    for text in save_left_behind(folder.path.parent):
        options.console.print(text, highlight=False, markup=False, soft_wrap=True)
    if options.faults is not None:
        shutil.copyfile(options.faults, folder.path / FAULTS)
    incidents = _lockstep(options, folder, script) if options.lockstep else _live(options, folder)
    mode: Mode = "lockstep" if options.lockstep else "processes"
    run = read_run(folder.recording)
    judged = evaluate(
        options.fleet,
        run,
        mode=mode,
        seed=options.seed,
        recording=str(folder.recording),
        incidents=incidents,
    )
    folder.write_summary(judged)
    draw_trajectories(options.fleet, run, folder.trajectories)
    draw_formation(options.fleet, run, folder.formation)
    return folder, judged


def _live(options: Options, folder: RunFolder) -> list[Fault]:
    with tempfile.TemporaryDirectory(prefix="echelon-") as runtime:
        fleet, notes = rehearsal(options.fleet, Path(runtime))
        for note in notes:
            options.console.print(note, highlight=False, markup=False, soft_wrap=True)
        folder.write_fleet(fleet)
        with (
            FleetLink.as_ground_station(fleet) as link,
            Recorder(folder.recording, fleet, _about(options)) as recorder,
            Supervisor(folder.logs) as supervisor,
            display(options.console) as shown,
        ):
            commands = _commands(fleet, folder, options)
            page = HandedSource(link)
            with _page(fleet, link, page, shown):
                conductor = Conductor(fleet, commands, link, recorder, supervisor, shown, page.hand)
                try:
                    return conductor.drive()
                except KeyboardInterrupt:
                    conductor.bring_to_rest()
                    raise


def _page(fleet: Fleet, link: FleetLink, source: HandedSource, shown: Display) -> PageServer:
    """The live page, on another port where the usual one is taken."""
    listen = Listen(or_any_port=True)
    server = PageServer(fleet, source, LinkCommands(fleet, link), listen=listen)
    taken = "" if server.port == listen.port else f" (port {listen.port} is in use)"
    shown.note(f"page: {server.url}{taken}")
    return server


def _about(options: Options) -> About:
    return About(time.time_ns(), "processes", options.seed)


def _script(options: Options) -> FaultScript | None:
    """The scripted faults, judged before anything is started. Raises FleetFileError."""
    return load_faults(options.faults, options.fleet.robots) if options.faults else None


def _commands(fleet: Fleet, folder: RunFolder, options: Options) -> Commands:
    common = ["--fleet", str(folder.fleet), "--seed", str(options.seed)]
    faults = ["--faults", str(folder.path / FAULTS)] if options.faults else []
    return Commands(
        simulator=[sys.executable, "-m", "sim_hw", *common, *faults],
        robots={
            name: [sys.executable, "-m", "onboard", *common, "--robot", name]
            for name in fleet.robots
        },
    )


def _lockstep(options: Options, folder: RunFolder, script: FaultScript | None) -> list[Fault]:
    from groundstation.lockstep import START_WALL_NS, LockstepFailed, run_lockstep

    fleet = options.fleet
    folder.write_fleet(fleet)
    quiet = not options.console.is_terminal
    about = About(START_WALL_NS, "lockstep", options.seed)
    with (
        Recorder(folder.recording, fleet, about) as recorder,
        Progress(console=options.console, disable=quiet, transient=True) as progress,
    ):
        task = progress.add_task("lockstep", total=fleet.mission.duration_s)

        def advance(mission_s: float) -> None:
            recorder.flush()
            progress.update(task, completed=mission_s)

        try:
            run_lockstep(fleet, options.seed, recorder.write, advance, script, replayable=True)
        except LockstepFailed as failure:
            return [Fault("fleet", 0.0, str(failure))]
    return []

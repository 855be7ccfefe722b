"""The shell around `Robot.step`: one thread on an absolute schedule.

The bus is drained at each tick: frames carry their own time of arrival, so nothing is lost by
not waking up for each of them.
"""

import gc
import sys
import time
from collections.abc import Callable

from onboard.canbus.black_box import BlackBox
from onboard.canbus.port import CanPort
from onboard.link import Link
from onboard.robot import Robot
from onboard.step import Inputs
from onboard.step_record import StepRecorder
from onboard.timing import LoopStatistics, Schedule

# A thread that holds the interpreter gives it up this often; the default of 5 ms is half a cycle.
SWITCH_INTERVAL_S = 0.0005


def run(
    robot: Robot,
    port: CanPort,
    link: Link,
    period_s: float,
    statistics: LoopStatistics,
    black_box: BlackBox | None,
    record: StepRecorder,
    shutdown: Callable[[], bool],
) -> None:
    """Step the robot until it is asked to shut down and has come to rest."""
    sys.setswitchinterval(SWITCH_INTERVAL_S)
    gc.collect()
    gc.freeze()
    schedule = Schedule(time.monotonic() + period_s, period_s)
    while not robot.finished:
        time.sleep(max(0.0, schedule.next_s - time.monotonic()))
        started_s, wall_s = time.monotonic(), time.time()
        late_s = started_s - schedule.next_s
        frames = port.receive(started_s, wall_s)
        inputs = Inputs(
            now_s=started_s,
            wall_s=wall_s,
            frames=frames,
            bus=port.health(),
            loop=statistics.health,
            late_s=late_s,
            motions=link.motions(),
            requests=link.requests(),
            estops=link.estops(),
            grounds=link.grounds(),
            unreadable=link.unreadable(),
            notes=port.take_notes(),
            free_disk_mb=None if black_box is None else black_box.free_mb,
            shutdown=shutdown(),
        )
        outputs = robot.step(inputs)
        port.send(outputs.frames)
        link.publish(outputs)
        link.record(record.messages(inputs, outputs))
        finished_s = time.monotonic()
        statistics.record(finished_s - started_s, late_s, schedule.advance(finished_s))

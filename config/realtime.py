"""Real-time priority of a process that must keep its schedule: a robot, or emulated hardware."""

import os

# Linux: children do not inherit the real-time policy.
SCHED_RESET_ON_FORK = 0x40000000


def request_realtime(priority: int) -> str | None:
    """Ask for SCHED_FIFO; returns None when granted, else why not and what to do."""
    if priority == 0:
        return "not requested (realtime_priority is 0)"
    policy = os.SCHED_FIFO | SCHED_RESET_ON_FORK
    try:
        os.sched_setscheduler(0, policy, os.sched_param(priority))
    except OSError as error:
        return (
            f"SCHED_FIFO {priority} refused ({error.strerror}): grant CAP_SYS_NICE or an rtprio "
            f"limit of {priority}, or run under systemd with CPUSchedulingPolicy=fifo"
        )
    return None

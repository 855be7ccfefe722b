"""A sample of `make estop-latency`, in measures of the robots' own cycle as it was meanwhile."""

import pytest

from tests.estop_latency import PATHS, measure
from tests.processes.bench import percentile

pytestmark = pytest.mark.process
CYCLES = {"ground station": 3.0, "echelon estop": 10.0}


def test_an_emergency_stop_reaches_every_drive_within_a_few_cycles() -> None:
    """Medians of both, so that a stall of a busy machine weighs nothing."""
    found = measure(3)
    cycle_ms = percentile(found.cycles_ms, 0.5)
    for path in PATHS:
        assert len(found.latencies_ms[path]) == 12
        assert percentile(found.latencies_ms[path], 0.5) <= CYCLES[path] * max(cycle_ms, 10.0)

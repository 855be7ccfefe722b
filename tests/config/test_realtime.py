"""Real-time priority is asked for, and a refusal says what to do."""

import os

import pytest

from config.realtime import request_realtime


def test_priority_zero_leaves_the_scheduler_alone() -> None:
    before = os.sched_getscheduler(0)
    assert "not requested" in (request_realtime(0) or "")
    assert os.sched_getscheduler(0) == before


def test_a_refused_priority_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    refusal = request_realtime(50)
    assert refusal is not None
    assert "SCHED_FIFO 50" in refusal
    assert "CAP_SYS_NICE" in refusal

"""Which row of the failsafe table, or which check before arming, a reason comes from."""

import re

from onboard.safety.triggers import TRIGGERS

_SENTENCES: tuple[tuple[str, str], ...] = (
    ("drive_heartbeat_lost", r"(drive|steering): no heartbeat"),
    ("drive_estimate_stale", r"(drive|steering): no encoder estimate"),
    ("drive_response", r"drive: the wheel turns at"),
    ("steering_response", r"steering: the fork is at"),
    ("watchdog_trip", r"(drive|steering): .*WATCHDOG_TIMER_EXPIRED"),
    ("drive_error", r"(drive|steering): "),
    ("encoder_stale", r"steering encoder: no angle"),
    ("encoder_error", r"steering encoder: "),
    ("steering_disagreement", r"steering drive and encoder disagree"),
    ("bearings_repeat", r"bearing sensor: the very same"),
    ("bearings_stale", r"bearing sensor: no usable bearing"),
    ("bearing_sensor_lost", r"bearing sensor: "),
    ("nis_alarm", r"bearings fit worse"),
    ("estimator_reset", r"lost r\d|\d+ of the last \d+ bearings|pose lost|not localised"),
    ("distance_low", r"range to r\d .* less 3 sigma"),
    ("unobservable", r".*unobservable for"),
    ("leader_stale", r"leader r\d: no message"),
    ("leader_unfit", r"leader r\d (does not know|is in state)"),
    ("bus_passive", r"CAN bus passive"),
    ("bus_off", r"CAN bus (bus-off|lost)"),
    ("send_queue_full", r"CAN bus: \d+ frames of one cycle"),
)
CHECK = "check "
"""In front of the name of a check before arming."""
ROWS = {row.name: row for row in TRIGGERS}


def trigger_of(reason: str) -> str:
    """Name of a trigger, or "check" and its name; the reason itself where it is neither."""
    if reason.startswith("refuses to "):
        refused = reason.partition(": ")[2]
        named = re.search(r"\[check (\w+)\]", refused)
        return CHECK + named[1] if named else trigger_of(refused)
    for trigger, sentence in _SENTENCES:
        if re.match(sentence, reason):
            return trigger
    return reason

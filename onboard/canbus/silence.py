"""When a message is overdue, and the sentence for it; one rule for every device and timeout."""

import math

ROUNDING_S = 1e-6


def overdue(message: str, age_s: float | None, limit_s: float) -> str | None:
    """Reason where the last `message` is older than its limit or never came (None), else None.

    The age is rounded up to 10 ms, so that it never reads as equal to the limit.
    """
    if age_s is None:
        return f"no {message} yet"
    if age_s <= limit_s + ROUNDING_S:
        return None
    shown_s = math.ceil((age_s - ROUNDING_S) * 100) / 100 if math.isfinite(age_s) else age_s
    return f"no {message} for {shown_s:.2f} s, limit {limit_s:.2f} s"


def silence(subject: str, message: str, age_s: float | None, limit_s: float) -> str | None:
    """The same with the name of who is silent in front."""
    reason = overdue(message, age_s, limit_s)
    return None if reason is None else f"{subject}: {reason}"

"""The newest message of every kind that one robot has told."""

from dataclasses import dataclass

from config.messages import (
    Bearings,
    Message,
    Motion,
    Observability,
    Particles,
    PoseEstimate,
    RelativeEstimate,
    Status,
    Truth,
)


@dataclass(slots=True)
class Known:
    """What is known of one robot; None where nothing of that kind was heard."""

    status: Status | None = None
    motion: Motion | None = None
    pose: PoseEstimate | None = None
    relative: RelativeEstimate | None = None
    bearings: Bearings | None = None
    observability: Observability | None = None
    particles: Particles | None = None
    truth: Truth | None = None

    def hear(self, message: Message) -> None:
        """Keep a message unless a newer one of its kind is known already."""
        field = _FIELDS.get(type(message))
        if field is not None:
            known = getattr(self, field)
            if known is None or known.wall_ns <= message.wall_ns:
                setattr(self, field, message)

    @property
    def newest(self) -> Status | Motion | None:
        """Whichever tells the robot's state last."""
        status, motion = self.status, self.motion
        if status is None or motion is None:
            return status or motion
        return motion if motion.wall_ns > status.wall_ns else status


_FIELDS: dict[type[Message], str] = {
    Status: "status",
    Motion: "motion",
    PoseEstimate: "pose",
    RelativeEstimate: "relative",
    Bearings: "bearings",
    Observability: "observability",
    Particles: "particles",
    Truth: "truth",
}

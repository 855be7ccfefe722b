"""What goes between server and page: JSON tagged by `kind`, in lists, and tagged by `do`.

Lengths are metres, times seconds, angles radians. Robots are in the fleet file's order.
"""

import msgspec

from config.messages import Observability
from groundstation.web.interface import PlaybackState

Numbers = list[float | None]


class RobotFrame(msgspec.Struct, frozen=True, omit_defaults=True):
    """What moves: sent 30 times a second. What is not known is left out.

    `pose` and `truth` are x, y, heading, steering.
    """

    fresh: bool = False
    pose: Numbers | None = None
    truth: Numbers | None = None


class RobotDetail(msgspec.Struct, frozen=True, omit_defaults=True):
    """What changes more slowly: sent 10 times a second. What is not known is left out.

    `ellipse` has half axes and direction, `offset` the wanted place in the leader's body axes,
    `looks` pairs of marker and body-frame bearing, `values` range error, bearing error, NIS and
    speed.
    """

    ellipse: Numbers | None = None
    offset: Numbers | None = None
    looks: list[tuple[int, float]] = []
    values: Numbers | None = None


class Frame(msgspec.Struct, frozen=True, tag_field="kind", tag="frame"):
    """One picture of the fleet. The page acknowledges `n`, so that it is never sent too many."""

    n: int
    t_s: float
    robots: list[RobotFrame]
    playback: PlaybackState | None = None


class Details(msgspec.Struct, frozen=True, tag_field="kind", tag="details"):
    """What goes with the frames."""

    t_s: float
    robots: list[RobotDetail]


class Drive(msgspec.Struct, frozen=True):
    """One motor drive."""

    state: str
    faults: list[str]
    temperature_degc: float | None


class Row(msgspec.Struct, frozen=True, omit_defaults=True):
    """One robot's line in the table, 5 times a second."""

    state: str = ""
    reason: str = ""
    ready: bool = False
    not_ready: list[str] = []
    mission_time_s: float | None = None
    formation: str = ""
    formation_error_m: float | None = None
    true_error_m: float | None = None
    age_s: float | None = None
    alive: bool | None = None
    loop_p50_ms: float | None = None
    loop_p99_ms: float | None = None
    overruns: int | None = None
    realtime: bool = True
    bus_state: str = ""
    bus_load: float | None = None
    send_failures: int = 0
    blocked_frames: int = 0
    steering: Drive | None = None
    drive: Drive | None = None
    battery_v: float | None = None
    clock_offset_ms: float | None = None
    observability: Observability | None = None
    nis_state: str = ""
    range_state: str = "ok"
    pose_trusted: bool = True


class Rows(msgspec.Struct, frozen=True, tag_field="kind", tag="rows"):
    """The table."""

    robots: list[Row]
    particles: list[list[tuple[float, float]]]


class LogLine(msgspec.Struct, frozen=True):
    """One line of the event log; `severity` is info, warning or error."""

    t_s: float
    source: str
    severity: str
    text: str


class Log(msgspec.Struct, frozen=True, tag_field="kind", tag="log"):
    """New lines of the event log."""

    lines: list[LogLine]


class Past(msgspec.Struct, frozen=True):
    """The last minute of one robot: times, values as in `RobotDetail`, trails as x, y."""

    t_s: list[float]
    values: list[Numbers]
    trail: list[Numbers]
    true_trail: list[Numbers]


class RobotFacts(msgspec.Struct, frozen=True):
    """What the fleet file says of one robot."""

    name: str
    leader: str | None
    wheelbase_m: float
    markers: list[tuple[int, float, float]]


class Hello(msgspec.Struct, frozen=True, tag_field="kind", tag="hello"):
    """What a page needs to begin with, and again when time has jumped."""

    fleet: str
    version: str
    live: bool
    robots: list[RobotFacts]
    landmarks: list[tuple[int, float, float]]
    formations: list[str]
    checks: list[str]
    mission_s: float
    now_s: float
    past: list[Past]
    log: list[LogLine]


class Commander(msgspec.Struct, frozen=True):
    """Who is in command since when; `elsewhere` at another ground station."""

    name: str
    since_s: float
    you: bool
    elsewhere: bool


class EstopShown(msgspec.Struct, frozen=True):
    """An emergency stop that was given here: by whom, when, and who has confirmed it."""

    by: str
    since_s: float
    confirmed: list[str]
    missing: list[str]
    repeating: bool


class Control(msgspec.Struct, frozen=True, tag_field="kind", tag="control"):
    """Who may do what on this page."""

    enabled: bool
    authorised: bool
    you: str
    viewers: int
    commander: Commander | None
    estop: EstopShown | None


class Answer(msgspec.Struct, frozen=True, tag_field="kind", tag="answer"):
    """What became of an order. `robots` has each robot's reason where it refused."""

    id: int
    accepted: bool
    text: str
    robots: dict[str, str]


class Introduce(msgspec.Struct, frozen=True, tag_field="do", tag="introduce"):
    """First message of a page: its token and its operator's name, both optional."""

    token: str = ""
    name: str = ""


class Got(msgspec.Struct, frozen=True, tag_field="do", tag="got"):
    """The page has drawn frame `n`."""

    n: int


class ShowTruth(msgspec.Struct, frozen=True, tag_field="do", tag="show_truth"):
    """Whether this page shows where simulated robots really are."""

    wanted: bool


class Estop(msgspec.Struct, frozen=True, tag_field="do", tag="estop"):
    """Emergency stop, by whoever sees the page."""


class Withdraw(msgspec.Struct, frozen=True, tag_field="do", tag="withdraw"):
    """Stop repeating the emergency stop to robots that do not confirm it."""


class TakeCommand(msgspec.Struct, frozen=True, tag_field="do", tag="take_command"):
    """Take command, from another operator too."""


class GiveBack(msgspec.Struct, frozen=True, tag_field="do", tag="give_back"):
    """Give command back."""


class Give(msgspec.Struct, frozen=True, tag_field="do", tag="order"):
    """An order for all robots; `id` comes back with the answer."""

    id: int
    name: str
    formation: str = ""


class Play(msgspec.Struct, frozen=True, tag_field="do", tag="play"):
    """Playback: `action` is play, pause, seek (value in s) or speed (value as a factor)."""

    action: str
    value: float = 0.0


FromPage = Introduce | Got | ShowTruth | Estop | Withdraw | TakeCommand | GiveBack | Give | Play
FROM_PAGE = msgspec.json.Decoder(FromPage)

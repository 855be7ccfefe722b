"""The report holds verdict, figures and log of a run, and needs nothing but its own file."""

import re
from pathlib import Path

import numpy as np
import pytest

from config.messages import Event, encode
from config.topics import EVENT
from groundstation.errors import GroundError
from groundstation.mission_log import GROUND_STATION
from groundstation.recorder import About, Recorder
from groundstation.report import write_report
from groundstation.report_data import believed_tracks, follower_bands, inside_two_sigma, read_told
from tests.groundstation.synthetic import START_NS, WALL_NS, Story, fleet, messages

HEADINGS = ("Summary", "Map", "Formation error", "Leader&#x27;s localisation", "Timeline", "Log")


def _record(path: Path, story: Story, drop: str = "nothing", incident: str = "") -> Path:
    with Recorder(path, fleet(duration_s=6.0), About(WALL_NS, "processes", 4)) as recorder:
        for key, body, wall_ns in messages(story):
            if not key.startswith(drop):
                recorder.write(key, body, wall_ns)
        if incident:
            event = Event(
                seq=0,
                t_ns=START_NS + 3_000_000_000,
                wall_ns=WALL_NS,
                source=GROUND_STATION,
                severity="error",
                text=incident,
            )
            recorder.write(EVENT.key("pair", "r2"), encode(event), WALL_NS)
    return path


def test_a_report_is_one_file_with_everything_in_it(tmp_path: Path) -> None:
    recording = _record(tmp_path / "run.mcap", Story(duration_s=6.0))
    written = write_report([recording])
    assert [(run.verdict, run.why) for run in written.runs] == [("pass", [])]
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert all(heading in html for heading in HEADINGS)
    assert html.count("data:image/svg+xml;base64,") >= 5
    assert re.findall(r"""(?:src|href|url)\\s*[=(]\\s*["']?(?!data:|#)""", html) == []
    assert "<script" not in html
    assert "mission complete" in html
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")


def test_two_runs_stand_beside_each_other_with_their_difference(tmp_path: Path) -> None:
    good = _record(tmp_path / "good.mcap", Story(duration_s=6.0))
    bad = _record(
        tmp_path / "bad.mcap",
        Story(duration_s=6.0, pose_error_m=0.25),
        incident="process <r2> ended by itself",
    )
    written = write_report([good, bad], tmp_path / "both")
    assert [run.verdict for run in written.runs] == ["pass", "fail"]
    assert "r1 pose estimate error 0.2500 m RMS" in " ".join(written.runs[1].why)
    assert "r2 at 3.00 s: process <r2> ended by itself" in written.runs[1].why
    html = Path(written.html).read_text(encoding="utf-8")
    assert "Both runs" in html
    assert "+0.2500 m" in html
    assert "process &lt;r2&gt; ended by itself" in html
    with pytest.raises(GroundError, match="3 recordings"):
        write_report([good, good, bad])


def test_a_run_without_truth_is_shown_as_it_was_believed(tmp_path: Path) -> None:
    recording = _record(tmp_path / "run.mcap", Story(duration_s=6.0), drop="truth/")
    told = read_told(recording)
    track = believed_tracks(told)["r2"]
    # At 3 s the leader is at x = 3 m, seen 0.1 m too far and 0.02 rad too far to the left.
    range_m, bearing_rad = np.hypot(1.0, 0.5) + 0.1, np.arctan2(-0.5, 1.0) + 0.02
    assert track.x_m[150] == pytest.approx(3.0 - range_m * np.cos(bearing_rad))
    assert track.y_m[150] == pytest.approx(-range_m * np.sin(bearing_rad))
    written = write_report([recording])
    assert written.runs[0].verdict == "fail"
    assert "nothing in this recording knows the truth" in Path(written.html).read_text()


def test_errors_are_counted_against_the_deviation_that_the_filter_claims(tmp_path: Path) -> None:
    told = read_told(_record(tmp_path / "run.mcap", Story(duration_s=6.0)))
    bands = follower_bands(told, "r2")
    band = bands["range [m]"]
    assert band.error is not None
    assert band.error == pytest.approx(0.1)
    assert inside_two_sigma(band, 0.0) == 0.0
    wide = band._replace(std=np.full(band.time_s.shape, 0.06))
    assert inside_two_sigma(wide, 0.0) == 1.0

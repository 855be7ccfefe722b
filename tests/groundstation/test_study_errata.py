"""Each erratum does what the corrected mathematics says, in sign and in size."""

import json
import math

import pytest
from typer.testing import CliRunner

from groundstation.cli import app
from groundstation.study.errata import EXPERIMENTS
from groundstation.study.errata_motion import noise_per_step

RUNNER = CliRunner()


@pytest.mark.parametrize(
    ("name", "literal", "corrected"),
    [
        # Largest path error: v omega Tc t / 2 grows to centimetres; the midpoint rule's to microns.
        ("euler", (0.03, 0.05), (0.0, 1e-4)),
        # Wound up by pi/3 for 4 s; held within asin(omega d / v) when read as d eta/dt.
        (
            "steering-rate-schedule",
            (4.18, 4.20),
            (0.0650, math.asin(math.pi / 3 * 0.25 / 4) + 1e-4),
        ),
        # The heading swings by 2 asin(omega d / v) = 0.13 rad; the filter follows half of it.
        ("fork-rate-input", (0.03, 0.13), (0.0, 0.002)),
        ("gamma-sign", (0.1, 2.0), (0.0, 1e-3)),
        ("five-quarter-pi", (3.0, math.pi), (0.0, 1e-3)),
        # exp(-0.1 * 9) and exp(-4 * 9) of the first error.
        ("paper-gains", (100 * math.exp(-0.9) - 0.2, 100 * math.exp(-0.9) + 0.2), (0.0, 1e-3)),
        ("literal-y3", (-20.0, -1.0), (3.0, 4.0)),
        ("leader-abeam", (50.0, 1e6), (0.0, 0.01)),
        ("arctan", (30.0, 70.0), (0.0, 0.0)),
    ],
)
def test_effect(name: str, literal: tuple[float, float], corrected: tuple[float, float]) -> None:
    effect = EXPERIMENTS[name]()
    assert effect.name == name
    assert literal[0] <= effect.literal <= literal[1]
    assert corrected[0] <= effect.corrected <= corrected[1]


def test_noise_per_step_makes_the_localiser_several_times_worse() -> None:
    effect = noise_per_step(seeds=1)
    assert effect.corrected < 0.1
    assert effect.literal > 2 * effect.corrected


def test_the_command_tells_one_line_per_option() -> None:
    result = RUNNER.invoke(app, ["study", "errata", "--literal-y3", "--five-quarter-pi"])
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert [line.split(":")[0] for line in lines] == ["literal-y3", "five-quarter-pi"]
    assert " -> " in lines[0]


def test_the_command_writes_one_document() -> None:
    result = RUNNER.invoke(app, ["study", "errata", "--paper-gains", "--json"])
    assert result.exit_code == 0
    effect = json.loads(result.stdout)["errata"]["paper-gains"]
    assert effect["literal"] == pytest.approx(40.7, abs=0.2)

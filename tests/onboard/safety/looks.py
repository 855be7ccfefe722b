"""One look at a healthy robot, to be spoilt one observation at a time."""

from dataclasses import replace

from onboard.canbus.drive.driver import MotorState
from onboard.canbus.port import BusState
from onboard.safety.observations import DriveSeen, EstimateSeen, LeaderSeen, Observations, Response
from onboard.safety.states import State

ACTIVE = DriveSeen(MotorState.ACTIVE, "in closed-loop control", 0.1, 0.01)
IDLE = replace(ACTIVE, state=MotorState.IDLE, reason="idle")
TRIPPED = replace(ACTIVE, state=MotorState.FAULT, reason="errors DRV_FAULT")
EXPIRED = replace(TRIPPED, reason="errors WATCHDOG_TIMER_EXPIRED", watchdog_expired=True)
GOOD = Observations(
    state=State.RUNNING,
    leader=LeaderSeen("r1", 0.01, "RUNNING", offset_s=0.001),
    bearing_age_s=0.02,
    bearing_problem=None,
    bearing_rate_hz=100.0,
    bearings_repeat_s=0.0,
    estimate=EstimateSeen(mutual_age_s=0.02),
    drive=ACTIVE,
    steering=ACTIVE,
    encoder_age_s=0.01,
    encoder_problem=None,
    steering_rad=0.1,
    disagreement_rad=0.01,
    speed_response=Response(1.0, 1.0, 1.0),
    steering_response=Response(0.1, 0.1, 0.1),
    bus_state=BusState.ACTIVE,
    bus_reason="open",
    bus_load=0.3,
    frames_dropped=0,
    loop_late_s=0.0,
    clock_step_s=0.0,
    ground_age_s=0.1,
    safety_node=None,
    realtime=True,
    free_disk_mb=None,
    ending=False,
    estop_by=None,
)
READY = replace(
    GOOD,
    state=State.STANDBY,
    drive=IDLE,
    steering=IDLE,
    disagreement_rad=None,
    speed_response=None,
    steering_response=None,
)

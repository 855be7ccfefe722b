"""When bearings count as contradicting a pose, landmark by landmark."""

import pytest

from onboard.estimate.consistency import Consistency

FITS, MISFITS = 0.5, 200.0
LOOK_S = 0.05


def lost_after_s(nis: dict[int, float], limit_s: float = 10.0) -> float | None:
    """Looks at these landmarks with these normalised innovations, until the pose is lost."""
    watch = Consistency()
    for look in range(round(limit_s / LOOK_S)):
        for landmark, value in nis.items():
            watch.observe(landmark, value)
        watch.judge(look * LOOK_S)
        if watch.lost:
            return look * LOOK_S
    return None


@pytest.mark.parametrize(
    ("agree", "against", "within_s"),
    [
        (0, 4, 1.6),
        (2, 2, 1.6),
        (1, 2, 1.6),
        (2, 3, 1.6),
        (0, 1, 5.1),
        (1, 1, 4.6),
        (2, 1, 4.6),
    ],
)
def test_a_pose_that_two_landmarks_fit_and_others_contradict_is_lost(
    agree: int, against: int, within_s: float
) -> None:
    nis = dict.fromkeys(range(agree), FITS) | {10 + n: MISFITS for n in range(against)}
    lost_s = lost_after_s(nis)
    assert lost_s is not None
    assert 1.0 <= lost_s <= within_s


@pytest.mark.parametrize(("agree", "against"), [(1, 0), (4, 0), (3, 1), (3, 2), (4, 4)])
def test_three_landmarks_that_agree_outvote_the_others(agree: int, against: int) -> None:
    nis = dict.fromkeys(range(agree), FITS) | {10 + n: MISFITS for n in range(against)}
    assert lost_after_s(nis) is None


def test_outliers_do_not_make_a_landmark_contradict() -> None:
    watch = Consistency()
    for look in range(400):
        for landmark in range(2):
            watch.observe(landmark, MISFITS if (look + landmark) % 3 == 0 else FITS)
        watch.judge(look * LOOK_S)
        assert not watch.lost


def test_a_gap_without_bearings_adds_nothing() -> None:
    watch = Consistency()
    for look in range(30):
        watch.observe(look % 2, MISFITS)
        watch.judge(look * 10.0 if look < 5 else 50.0 + look * 0.01)
    assert not watch.lost

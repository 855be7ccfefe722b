"""The paper's particle filter with the paper's input: omega of (3), the fork's rate in the world.

A robot knows d delta/dt instead, so the onboard filter takes that. With omega the steering angle of
every particle decays by itself, as delta' = omega - v sin(delta)/d; with d delta/dt it does not.
"""

import numpy as np

from onboard.estimate.localiser_particle import FORK, HEADING, ParticleLocaliser, X, Y


class PaperParticles(ParticleLocaliser):
    """`ParticleLocaliser` with another first step; weights and resampling are the same."""

    def predict(self, dt_s: float, speed_mps: float, fork_rate_radps: float) -> None:
        """Advance by `dt_s` with (3) by the midpoint rule, and add the process noise."""
        s, rates = self._states, self._rates
        turning = speed_mps / self._wheelbase_m
        heading = s[HEADING] + dt_s / 2 * turning * np.sin(s[FORK] - s[HEADING])
        fork = s[FORK] + dt_s / 2 * fork_rate_radps
        rates[X] = speed_mps * np.cos(fork)
        rates[Y] = speed_mps * np.sin(fork)
        rates[FORK] = fork_rate_radps
        rates[HEADING] = turning * np.sin(fork - heading)
        s += dt_s * rates
        self._add_noise(dt_s, standing=False)

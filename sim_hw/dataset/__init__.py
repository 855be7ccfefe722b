"""Playback of recorded data sets as emulated hardware."""

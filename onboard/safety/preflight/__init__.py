"""The checks before arming, one per file; each returns a reason when the robot is not ready."""

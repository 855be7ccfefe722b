"""The one exception that the ground station shows to people as a message, without a traceback."""


class GroundError(Exception):
    """Something that the operator can put right; the text says what, where and what to do."""

"""The compiled CAN database, once for all tests of this folder."""

import pytest

from config.can.database import CanDatabase


@pytest.fixture(scope="session")
def database() -> CanDatabase:
    return CanDatabase.load()

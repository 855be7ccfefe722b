"""The synthetic data set, and the real one where it lies beside the checkout."""

from pathlib import Path

import pytest

from tests.dataset.synthetic import write_data_set

REAL = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "mrclam6"


@pytest.fixture
def data_set(tmp_path: Path) -> Path:
    """A folder with a small data set of one robot."""
    folder = tmp_path / "set"
    folder.mkdir()
    write_data_set(folder)
    return folder


@pytest.fixture
def real_data_set() -> Path:
    """MRCLAM data set 6, which the project does not redistribute."""
    if not REAL.is_dir():
        pytest.skip(f"real robots' data not found: {REAL} is missing")
    return REAL

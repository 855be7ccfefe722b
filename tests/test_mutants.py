"""The list of mutants fits the code, so that none of them changes nothing."""

from pathlib import Path

import pytest

from tests.mutants import MUTANTS, ROOT, Mutant, Stale, apply


@pytest.mark.parametrize("mutant", MUTANTS, ids=[mutant.breaks for mutant in MUTANTS])
def test_each_mutant_finds_its_text_exactly_once_and_its_tests(mutant: Mutant) -> None:
    assert (ROOT / mutant.file).read_text().count(mutant.old) == 1
    assert mutant.old != mutant.new
    for name in mutant.tests:
        assert (ROOT / name).is_file()


def test_a_mutant_whose_text_is_gone_fails_loudly(tmp_path: Path) -> None:
    (tmp_path / "code.py").write_text("limit = 1\n")
    with pytest.raises(Stale, match=r"found 0 x in code\.py"):
        apply(Mutant("limit", "code.py", "limit = 2", "limit = 3", ()), tmp_path)

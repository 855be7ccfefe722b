# A newcomer types `make demo` or `make test`; both set up .venv themselves.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.installed

.PHONY: demo test lint types check acceptance campaign clean setup

demo: setup
	$(BIN)/echelon demo $(ARGS)

test: lint types check

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: setup
	$(BIN)/mypy

check: setup
	$(BIN)/python -m pytest -n 2 -m "not process" $(ARGS)
	$(BIN)/python -m pytest -m process $(ARGS)

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; assert sys.version_info >= (3, 11), f"Echelon needs Python 3.11 or newer, {sys.executable} is {sys.version.split()[0]}: try make PYTHON=python3.11"'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[operator,dev]'
	touch $@

# Every shipped fleet, both laws, 20 seeds in lockstep: about 15 minutes on two cores.
acceptance: setup
	$(BIN)/python -m tests.acceptance $(ARGS)

# Every fault of every device, then 500 random pairs: docs/campaign.md. Interrupted, it goes on.
campaign: setup
	$(BIN)/python -m tests.campaign single
	$(BIN)/python -m tests.campaign double
	$(BIN)/python -m tests.campaign docs

clean:
	rm -rf .venv build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis

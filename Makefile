# A newcomer types `make demo` or `make test`; both set up .venv themselves.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.installed

.PHONY: demo test lint types check browser pictures acceptance clean setup

demo: setup
	$(BIN)/echelon demo $(ARGS)

test: lint types check

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: setup
	$(BIN)/mypy

check: setup browser
	$(BIN)/python -m pytest -n 2 -m "not process" $(ARGS)
	$(BIN)/python -m pytest -m process $(ARGS)

# The page is tested in Debian's own Chromium.
browser:
	@command -v chromium >/dev/null || { [ "$$(id -u)" = 0 ] && apt-get update -qq && apt-get install -y -qq --no-install-recommends chromium >/dev/null; } || { echo "the browser tests need chromium: run 'make browser' as root, or 'apt-get install chromium'" >&2; exit 1; }

# The pictures of the page in docs/groundstation.md, from real processes.
pictures: setup browser
	$(BIN)/python -m tests.web.pictures $(ARGS)

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	$(PYTHON) -c 'import sys; assert sys.version_info >= (3, 11), f"Echelon needs Python 3.11 or newer, {sys.executable} is {sys.version.split()[0]}: try make PYTHON=python3.11"'
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[operator,dev]'
	touch $@

# Every shipped fleet, both laws, 20 seeds in lockstep: about 15 minutes on two cores.
acceptance: setup
	$(BIN)/python -m tests.acceptance $(ARGS)

clean:
	rm -rf .venv build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis

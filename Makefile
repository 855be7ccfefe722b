# A newcomer types `make demo` or `make test`; both set up .venv themselves.
PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.installed

.PHONY: demo test lint types check browser pictures acceptance campaign fuzz kills soak estop-latency mutants clean setup

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

# Every fault of every device, then 500 random pairs: docs/campaign.md. Interrupted, it goes on.
campaign: setup
	$(BIN)/python -m tests.campaign single
	$(BIN)/python -m tests.campaign double
	$(BIN)/python -m tests.campaign docs

# Evidence of docs/evidence.md. Each prints its seed, and takes other settings by ARGS="...".
# 1,000,000 frames and 200,000 payloads into running robots: about 10 minutes; goes on where it was.
fuzz: setup
	$(BIN)/python -m tests.fuzz $(ARGS)

# 30 rounds of signals to real processes: about 10 minutes.
kills: setup
	$(BIN)/python -m tests.processes.kills $(ARGS)

# 2 hours of virtual time (about 40 minutes) and 20 minutes of real processes; goes on where it was.
soak: setup
	$(BIN)/python -m tests.soak $(ARGS)

# From the operator to the drives' frames, in real processes: about 6 minutes.
estop-latency: setup
	$(BIN)/python -m tests.estop_latency $(ARGS)

# Breaks the safety code on purpose; every mutant must be killed by a test: about 4 minutes.
mutants: setup
	$(BIN)/python -m tests.mutants $(ARGS)

clean:
	rm -rf .venv build *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis

# Everything happens in .venv, made on first use. Needs Python 3.11 or newer and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
MADE := $(VENV)/.made
RUNS := $(VENV)/.runs
FETCHED := $(VENV)/.fetched

# The matrices are small: threads of the linear algebra would only take the cores from each other.
export OPENBLAS_NUM_THREADS := 1
export OMP_NUM_THREADS := 1
# Tests start some hundreds of programs: without compiled modules on disk each would compile them anew, for a second.
export PYTHONDONTWRITEBYTECODE :=

.PHONY: setup fetched demo docs chaos soak kills figures test quick lint types pytest sanitize fuzz wheel-check clean

setup: $(MADE)

SOURCES := pyproject.toml setup.py library/compiled/loops.c
# setuptools warns of every editable installation.
# Quiet twice: pip says its errors, but no warnings (of an index that is not there, say).
PIP := PYTHONWARNINGS=ignore $(BIN)/python -m pip --quiet --quiet --disable-pip-version-check
INSTALL := $(PIP) install --editable

$(VENV)/pyvenv.cfg:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "kinespace needs Python 3.11 or newer: make PYTHON=python3.12 ..."; exit 2; }
	@echo 'setup: making $(VENV), and pip new in it ...'
	@$(PYTHON) -m venv $(VENV)
	@$(PIP) install --upgrade pip

# The programs alone: quicker than what the tests need, too.
$(RUNS): $(SOURCES) | $(VENV)/pyvenv.cfg
	@echo 'setup: pip fetches what kinespace needs, and installs it into $(VENV) ...'
	@$(INSTALL) .
	@touch $@

# LOCKED=1 installs the packages that .ci/locked.txt names, by their hashes, in place of the newest ones.
$(MADE): $(SOURCES) | $(VENV)/pyvenv.cfg
	@echo 'setup: pip fetches what kinespace and its tests need (a minute), and installs it into $(VENV) ...'
	@$(if $(LOCKED),$(PIP) install --require-hashes -r .ci/locked.txt)
	@$(INSTALL) '.[dev]'
	@touch $(RUNS) $@

# The models and the film that tests of the camera need: no test asks a network. Tried once after each set-up, because
# without a network it takes long; `make fetched` tries again.
$(FETCHED): $(MADE)
	@$(BIN)/python tests/support/network/fetched.py
	@touch $@

fetched: setup
	@$(BIN)/python tests/support/network/fetched.py

# Eight minutes of attacks and faults, and their effect on a performer; `make test` runs a short form.
# `make chaos TRIALS=--help` lists its options.
chaos: setup
	PYTHONPATH=tests:tests/support $(BIN)/python -m chaos $(TRIALS)

# An hour of a stage in ten minutes: does memory grow, is a descriptor or a thread left?
soak: setup
	PYTHONPATH=tests:tests/support $(BIN)/python -m chaos.soak $(SOAK)

# `live --teach` is killed two hundred times: is an example lost?
kills: setup
	PYTHONPATH=tests:tests/support $(BIN)/python -m chaos.kills $(KILLS)

# Every figure of recognition and retrieval, some minutes; `make test` measures a few. `FIGURES=--update` writes them.
figures: setup
	$(BIN)/python tests/figures.py $(FIGURES)

demo: $(RUNS)
	@$(BIN)/kinespace demo

# README, the pages of .github/docs and the programming interface as a site: build/docs/index.html.
docs: setup types
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet --config-file .ci/mkdocs.yml

# mypy runs beside the tests, because many of them wait for real time.
test: setup
	@$(MAKE) --no-print-directory -j2 lint types pytest

# For trying a change while it is made: leaves out tests that play in real time, start programs or read many takes.
quick: setup
	@$(MAKE) --no-print-directory -j2 lint types pytest WORKERS=auto CHOSEN='-m "not slow"'

lint: setup
	$(BIN)/ruff check
	$(BIN)/ruff format --check

# mypy looks for packages by folder: this lays ours out below the one name that they are imported by.
PACKAGES := $(VENV)/packages/kinespace
types: setup
	@mkdir -p $(PACKAGES) && cd $(PACKAGES) && ln -sfn ../../../library library && ln -sfn ../../../stream stream && ln -sfn ../../../tools tools && ln -sfn ../../../tools/front/__init__.pyi __init__.pyi
	$(BIN)/mypy

# In more processes than there are cores, because many tests wait for real time: on two cores four took 263 s, five 233. A
# process that has finished takes tests from another, because a few of them take half a minute.
WORKERS := $(shell $(PYTHON) -c 'import os; print(3 * (os.cpu_count() or 1) // 2 + 2)')
pytest: setup $(FETCHED)
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal $(CHOSEN)

# The compiled loops under AddressSanitizer and UBSan.
sanitize: setup
	.ci/sanitize

# Some minutes of packets made to break a feed, so many for each of 24 readers, and some ten of files made to break
# theirs; `make test` sends ten thousand packets, and reads some hundred files.
PACKETS ?= 60000
FILES ?= 20000
BROKEN := no_packet_raises or no_message_raises or any_bytes or no_file_ends
fuzz: setup
	FILES=$(FILES) PACKETS=$(PACKETS) $(BIN)/python -m pytest -q -n0 -k '$(BROKEN)' tests/system/strangers tests/stream/test_codecs.py

# A wheel that is built twice, in two folders, is the same; installed in an environment of its own, away from the
# sources, it does the main job.
WHEEL := SOURCE_DATE_EPOCH=1700000000 $(CURDIR)/$(BIN)/python -m pip wheel --quiet --quiet --disable-pip-version-check --no-deps
wheel-check: setup
	rm -rf build/wheel build/lib build/lib.* build/bdist.* && mkdir -p build/wheel/first build/wheel/second
	tar -c --exclude-vcs --exclude=./.venv --exclude=./build . | tar -x -C build/wheel/second
	$(WHEEL) --wheel-dir build/wheel .
	cd build/wheel/second && $(WHEEL) --wheel-dir ../first .
	cmp build/wheel/*.whl build/wheel/first/*.whl
	$(PYTHON) -m venv build/wheel/venv
	build/wheel/venv/bin/python -m pip install --quiet --quiet --disable-pip-version-check build/wheel/*.whl
	cd build/wheel && venv/bin/kinespace info && venv/bin/kinespace demo --json

clean:
	rm -rf $(VENV) build dist *.egg-info library/compiled/_loops.* .mypy_cache .ruff_cache .pytest_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

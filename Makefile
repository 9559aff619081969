# make studies         run every study: datasets, figures and results/report.html
# make quick           the same on coarse grids, into results/quick
# make report          write results/report.html again from the stored findings
# make check-results   compute some stored cases again and compare them to the last bit (FRESH=1: every case)
# make test            run the fast tests            make test-all   run all tests
# make lint            run ruff and mypy             make docs       build the site, into docs/_build/html
# make bench           time the kernels against C    make peers      run the same tops in other libraries
# make engines         run physics engines        make wheel      build a wheel with compiled kernels, into dist/
# make clean           delete .venv, caches and what studies stored
# make archive         bundle the results for a repository of data, into results/
# make snapshot        copy the report and its figures to docs/snapshot, which the repository holds
# Each target makes .venv first if it is missing or out of date.

PYTHON ?= python3
BIN := .venv/bin
READY := .venv/.ready
DOCS := .venv/.docs
PEERS := benchmarks/peers/.venv
ENGINES := benchmarks/engines/.venv
OLDER := benchmarks/engines/.venv-mujoco-3
LEFT := $(if $(wildcard results/quick/report.html),slow,slow or quick) # every study, quickly, takes minutes by itself
APART := --numprocesses auto --dist loadfile --no-loadscope-reorder # a file to a process, in the order of tests/conftest.py

# Where the environment forbids Python to keep its bytecode, each process compiles hundreds of files anew, 0.6 s.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.PHONY: help setup studies quick report check-results test test-all lint bench peers engines docs snapshot archive wheel clean

help:
	@sed -n '1,12s/^# //p' Makefile

setup: $(READY)

$(READY): pyproject.toml constraints.txt
	@echo "symtop: making .venv with $$($(PYTHON) --version) and installing the pinned packages (a minute or two, once)"
	@$(PYTHON) -m venv .venv
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt --upgrade pip
	@$(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check --constraint constraints.txt \
	  --editable . --group dev
	@$(BIN)/python -m compileall -qq -j 0 -x '/tests?/' .venv || true # on every core, where pip uses one
	@touch $(READY)

studies: $(READY)
	@echo "symtop: running every study; cases that are stored and up to date are not computed again"
	@$(BIN)/symtop study --all
	@$(BIN)/symtop report

quick: $(READY)
	@echo "symtop: running every study on a coarse grid, into results/quick"
	@$(BIN)/symtop study --all --quick
	@$(BIN)/symtop report --results results/quick

report: $(READY)
	@$(BIN)/symtop report

check-results: $(READY)
	@echo "symtop: computing some stored cases again and comparing them (FRESH=1: every case)"
	@$(BIN)/symtop study --all --check $(if $(FRESH),--fresh)

test: $(READY)
	@echo "symtop: running the tests that are not marked: $(strip $(LEFT)) (after make quick, those too; make test-all: all)"
	@$(BIN)/python -m pytest -m "not ($(strip $(LEFT)))" $(APART)

test-all: $(READY)
	@echo "symtop: running all tests"
	@$(BIN)/python -m pytest $(APART)

lint: $(READY)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy

snapshot: $(READY)
	@$(BIN)/python docs/generator/snapshot.py

archive: $(READY)
	@$(BIN)/symtop archive

wheel: $(READY)
	@echo "symtop: compiling the kernels that are used first, a minute or two"
	@SYMTOP_COMPILE_WITH=$(abspath $(BIN)/python) $(BIN)/python -m pip wheel --quiet --no-deps --wheel-dir dist .

docs: $(DOCS)
	@echo "symtop: building the site (half a minute); a warning is an error"
	@$(BIN)/python -m sphinx -W --keep-going -q -b html -d docs/_build/doctrees docs docs/_build/html
	@echo "symtop: docs/_build/html/index.html"

$(DOCS): $(READY) docs/constraints.txt
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt \
	  --constraint docs/constraints.txt --group docs
	@touch $(DOCS)

bench: $(READY)
	@echo "symtop: timing the kernels against C (needs gcc)"
	@$(BIN)/python -m benchmarks.bench

peers: $(PEERS)/.ready
	@echo "symtop: running the same tops in other libraries (about six minutes; other work on the machine disturbs the times)"
	@$(PEERS)/bin/python -m benchmarks.peers
	@rm -f MUJOCO_LOG.TXT # MuJoCo's own warnings on runs whose step is too long

$(PEERS)/.ready: pyproject.toml constraints.txt benchmarks/peers/constraints.txt
	@echo "symtop: making $(PEERS) and installing other libraries (a gigabyte, some minutes, once)"
	@$(PYTHON) -m venv $(PEERS)
	@$(PEERS)/bin/python benchmarks/peers/install.py
	@touch $(PEERS)/.ready

engines: $(ENGINES)/.ready
	@echo "symtop: running physics engines against their maps (a minute)"
	@$(ENGINES)/bin/python -m benchmarks.engines
	@if [ -x $(OLDER)/bin/python ]; then $(OLDER)/bin/python -m benchmarks.engines --only mujoco --add; fi

$(ENGINES)/.ready: pyproject.toml constraints.txt benchmarks/engines/constraints.txt benchmarks/engines/node/package.json
	@echo "symtop: making $(ENGINES) and installing physics engines (a gigabyte, some minutes, once)"
	@$(PYTHON) -m venv $(ENGINES)
	@$(ENGINES)/bin/python benchmarks/engines/install.py
	@$(PYTHON) -m venv $(OLDER)
	@$(OLDER)/bin/python benchmarks/engines/install.py mujoco==3.17.0
	@touch $(ENGINES)/.ready

clean:
	rm -rf .venv $(PEERS) $(ENGINES) $(OLDER) .pytest_cache .ruff_cache .mypy_cache benchmarks/build docs/_build results/cases results/quick
	find results -maxdepth 1 \( -name '*.nc' -o -name '*.json' \) ! -name 'peers.*' ! -name bench.json ! -name guard.json \
	  ! -name horizon.json ! -name live-engines.json ! -name repeat.json ! -name machines.json -delete # what the repository holds stays

# Two commands do everything on a machine with Python ≥ 3.11 and make: `make tables` and `make test`.
SCALE ?= quick
PYTHON ?= python3
WORKERS ?= $(shell $(PYTHON) -c "import os; print(os.cpu_count())")
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.ready
INSTALL := $(BIN)/python -m pip install --quiet --no-deps --no-build-isolation
# ALL=1 adds the refined rows and the oracle's.
ALL ?=
# The data of P6–P9 that stands beside this scale's tables; data.hard of conf/data says so too.
HARD := $(if $(filter paper x10,$(SCALE)),hard,hard_quick)
# Likewise of P10–P15.
SCAN := $(if $(filter paper x10,$(SCALE)),scan,scan_quick)

.PHONY: setup test lint data tables publish figures bench docs clean
.DEFAULT_GOAL := tables

setup: $(STAMP)

# Every file is held against its hash. setuptools comes first because antlr4, which has no wheel, is built with it. What
# is still missing then are CUDA's libraries, where PyTorch's build wants them. PyTorch itself comes by its version alone:
# its builds for CPUs and GPUs differ, and pip takes the one that this machine is set up for.
$(STAMP): pyproject.toml constraints.txt constraints-cuda.txt
	$(PYTHON) -c "import sys; sys.exit(sys.version_info < (3, 11) and 'symshrec needs Python 3.11 or newer; name one with make PYTHON=…')"
	@echo "Setting up $(VENV): PyTorch and all that stands on it, a few minutes the first time"
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	sed -n '/^setuptools==/,/[^\\]$$/p' constraints.txt > $(VENV)/setuptools.txt
	$(INSTALL) --require-hashes --requirement $(VENV)/setuptools.txt
	$(INSTALL) $$(sed -n 's/^\(torch==[0-9.]*\).*/\1/p' constraints.txt)
	$(INSTALL) --require-hashes --requirement constraints.txt
	$(INSTALL) --editable .
	$(BIN)/python -m pip check > $(VENV)/missing.txt || $(INSTALL) --require-hashes --requirement constraints-cuda.txt
	$(BIN)/python -m pip check
	touch $@

test: setup
	$(BIN)/python -m pytest --numprocesses=auto --maxprocesses=4 --dist=worksteal

# The pages as a site in site/, warnings being errors; nothing is fetched.
docs: setup
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet
	@echo "written: site/index.html"

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/mypy

# Verifies what is there and makes what is missing; killed at any moment, it goes on where it was.
data: setup
	$(BIN)/symshrec generate data=$(SCALE) workers=$(WORKERS)
	$(BIN)/symshrec generate data=$(HARD) workers=$(WORKERS)
	$(BIN)/symshrec generate data=$(SCAN) workers=$(WORKERS)

# Data, all rows and the tables in one process, which says how long it will take and goes on where it was.
tables: setup
	$(BIN)/symshrec reproduce data=$(SCALE) rows.all=$(if $(ALL),true,false) workers=$(WORKERS) method.workers=$(WORKERS)

# Copies what `make tables` wrote under runs/ into results/, which git keeps.
publish: setup
	$(BIN)/python experiments/publish.py data=$(SCALE)

figures: setup
	$(BIN)/symshrec figures

bench: setup
	$(BIN)/symshrec bench

clean:
	rm -rf $(VENV) data runs site

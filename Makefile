# Two commands: `make run` and `make test`. Both do all the set-up; the second time they start at once.
.PHONY: run test bench lint types layers check lock clean
.DEFAULT_GOAL := run

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
ARGS ?=
FAMILIES := --extra ur --extra modbus --extra serial
# Drivers beyond the demo are tested too.
TESTED := $(FAMILIES) --extra can --extra dynamixel

run: .make/run
	$(BIN)/arcor2-hw demo $(ARGS)

test: .make/dev
	$(BIN)/python -m pytest $(ARGS)

bench: .make/dev
	$(BIN)/python -m benchmarks $(ARGS)

check: lint types layers

lint: .make/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: .make/dev
	$(BIN)/mypy

layers: .make/dev
	$(BIN)/lint-imports

# ---------------------------------------------------------------------------------------------------- set-up
# A stamp per set of wheels: a set is installed once, and again only when its lock or the project's own metadata changes.
.make/venv:
	@mkdir -p .make
	@$(PYTHON) -m venv $(VENV) || { test "$$(id -u)" = 0 && apt-get update -qq && apt-get install -y -qq python3-venv && $(PYTHON) -m venv $(VENV); }
	@touch $@

.make/run: requirements/run.txt pyproject.toml | .make/venv
	@test -e .make/dev && test .make/dev -nt requirements/dev.txt || $(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements/run.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

.make/dev: requirements/dev.txt pyproject.toml | .make/venv
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements/dev.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

# ---------------------------------------------------------------------------------------------------- maintenance
# Run by a maintainer with pip-tools at hand. No index address gets into the locks.
COMPILE := pip-compile --quiet --upgrade --generate-hashes --allow-unsafe --strip-extras \
	--no-emit-index-url --no-emit-find-links --no-emit-trusted-host --no-header
lock:
	$(COMPILE) $(TESTED) --extra build --extra dev --output-file requirements/dev.txt pyproject.toml
	$(COMPILE) $(FAMILIES) --extra build --constraint requirements/dev.txt --output-file requirements/run.txt pyproject.toml

clean:
	rm -rf $(VENV) .make .mypy_cache .ruff_cache .pytest_cache

# Two commands: `make run` and `make test`. Both do all the set-up; the second time they start at once.
.PHONY: run test bench bench-compare bench-long bench-editor mutation dist dist-try lint types layers check-editor check lock clean
.DEFAULT_GOAL := run

PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
ARGS ?=
EXTRAS := $(foreach extra,ur modbus serial can dynamixel depthai opcua mqtt nodes history postgresql vision kinematics,--extra $(extra))

# Compiled modules are kept, whatever the environment says: a test run starts some hundred Python processes, and each of
# them would compile all of ours again.
unexport PYTHONDONTWRITEBYTECODE

run: .make/run .make/editor
	$(BIN)/arcor2-hw demo $(ARGS)

# The tests are compiled once, next to the tests of the editor's units: otherwise each worker compiles all of them.
# Tests mostly wait for simulated devices, so six workers suit two cores. Failed tests run once more without others, since
# a few still depend on tenths of a second; both results are shown. Exit code 5 means that ARGS selected no test.
# Everything, also the combinations that are checked only before a change is merged: make test ARGS=--matrix
WORKERS ?= 6
AGAIN := --last-failed --last-failed-no-failures none
test: .make/dev .make/editor .make/browser .make/postgresql .make/broker .make/mosquitto
	$(BIN)/python -m pytest --collect-only -qq >/dev/null & $(BIN)/python editor/build.py test; status=$$?; wait; exit $$status
	$(BIN)/python -m pytest --numprocesses $(WORKERS) --dist loadgroup --no-loadscope-reorder $(ARGS) || \
	test $$? = 5 || $(BIN)/python -m pytest $(AGAIN) $(ARGS)

bench: .make/dev
	$(BIN)/python -m benchmarks $(ARGS)

# Measure this checkout and another revision, alternating: make bench-compare ARGS="v0.1 requests documents"
bench-compare: .make/dev
	$(BIN)/python -m benchmarks.compare $(ARGS)

# Interrupt and restore every transport 300 times instead of 18; takes half an hour.
bench-long: .make/dev
	$(BIN)/python -m benchmarks --long recovery $(ARGS)

# Measure loading, drawing and event latency of the editor, in Chromium with software rendering.
bench-editor: .make/dev .make/editor .make/browser
	$(BIN)/python -m benchmarks.editor $(ARGS)

# Change the journal, the lock table and the lane of a device in small ways, and count what the tests notice. In a crash
# or on a loaded server, a fault there loses data or moves a device. All of them take an hour or two; a sample of the
# journal's: make mutation ARGS="journal --sample 200"
mutation: .make/mutation
	$(BIN)/python -m tests.mutation $(ARGS)

# Build a bundle that installs without a network, and a Debian package; sign them: make dist MINISIGN_KEY=FILE
dist: .make/release .make/editor
	$(BIN)/python .ci/release.py $(ARGS)

# Install, break and upgrade the Debian package of `make dist` in a container with systemd. Needs root and debootstrap.
dist-try: .make/release
	$(BIN)/python .ci/try_release.py

check: lint types layers check-editor

lint: .make/dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell

types: .make/dev
	$(BIN)/mypy

layers: .make/dev
	$(BIN)/lint-imports

check-editor: .make/node
	$(BIN)/python editor/build.py check

# ---------------------------------------------------------------------------------------------------- set-up
# A stamp per set of wheels: a set is installed once, and again only when its lock or the project's own metadata changes.
.make/venv:
	@mkdir -p .make
	@$(PYTHON) -m venv $(VENV) || { test "$$(id -u)" = 0 && apt-get update -qq && apt-get install -y -qq python3-venv && $(PYTHON) -m venv $(VENV); }
	@touch $@

# Open3D loads these; where they are missing and we may, they are installed, otherwise they are named.
LIBRARIES := libEGL.so.1:libegl1 libGL.so.1:libgl1 libusb-1.0.so.0:libusb-1.0-0 libgomp.so.1:libgomp1
.make/system:
	@mkdir -p .make
	@for each in $(LIBRARIES); do ldconfig -p | grep -q "$${each%%:*}" || missing="$$missing $${each##*:}"; done; \
	if test -n "$$missing"; then \
	  if test "$$(id -u)" = 0; then apt-get update -qq && apt-get install -y -qq --no-install-recommends $$missing >/dev/null; \
	  else echo "please install:$$missing" >&2; exit 1; fi; \
	fi
	@touch $@

.make/run: requirements/run.txt pyproject.toml .make/system | .make/venv
	@test -e .make/dev && test .make/dev -nt requirements/dev.txt || $(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements/run.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

.make/dev: requirements/dev.txt pyproject.toml .make/system | .make/venv
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements/dev.txt
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	@touch $@

.make/mutation: requirements/mutation.txt | .make/dev
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements/mutation.txt
	@touch $@

.make/release: requirements/release.txt | .make/dev
	$(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r requirements/release.txt
	@touch $@

# Node.js: the machine's, or the one from PyPI where it is missing or too old.
.make/node: editor/node.txt editor/build.py | .make/venv
	@mkdir -p .make
	@$(BIN)/python editor/build.py --find-node 2>/dev/null || $(BIN)/pip install --quiet --disable-pip-version-check --require-hashes -r editor/node.txt
	@touch $@

# The editor, built again when its sources changed.
EDITOR := $(shell find editor -name node_modules -prune -o -name __pycache__ -prune -o -type f -print)
.make/editor: $(EDITOR) | .make/node
	$(BIN)/python editor/build.py
	@touch $@

# The browser in which the editor is tested: Chromium without a window, where the distribution has it.
.make/browser:
	@mkdir -p .make
	@command -v chromium-headless-shell >/dev/null || command -v chromium >/dev/null || { \
	  if test "$$(id -u)" = 0; then apt-get update -qq && \
	    apt-get install -y -qq --no-install-recommends chromium-headless-shell >/dev/null || \
	    apt-get install -y -qq --no-install-recommends chromium >/dev/null; \
	  else echo "please install: chromium-headless-shell or chromium" >&2; exit 1; fi; \
	}
	@touch $@

# The tests start a PostgreSQL server of their own. The package alone would create and start another one.
.make/postgresql:
	@mkdir -p .make
	@ls /usr/lib/postgresql/*/bin/initdb >/dev/null 2>&1 || { \
	  if test "$$(id -u)" = 0; then apt-get update -qq && \
	    apt-get install -y -qq --no-install-recommends postgresql-common >/dev/null && \
	    sed -i 's/^#\?create_main_cluster.*/create_main_cluster = false/' /etc/postgresql-common/createcluster.conf && \
	    apt-get install -y -qq --no-install-recommends postgresql >/dev/null; \
	  else echo "please install: postgresql" >&2; exit 1; fi; \
	}
	@touch $@

# The broker between a server and its nodes.
.make/broker:
	@mkdir -p .make
	@command -v nats-server >/dev/null || test -x /usr/sbin/nats-server || { \
	  if test "$$(id -u)" = 0; then apt-get update -qq && apt-get install -y -qq --no-install-recommends nats-server >/dev/null; \
	  else echo "please install: nats-server" >&2; exit 1; fi; \
	}
	@touch $@

# The MQTT broker of the tests. Each starts its own.
.make/mosquitto:
	@mkdir -p .make
	@command -v mosquitto >/dev/null || test -x /usr/sbin/mosquitto || { \
	  if test "$$(id -u)" = 0; then apt-get update -qq && apt-get install -y -qq --no-install-recommends mosquitto >/dev/null; \
	  else echo "please install: mosquitto" >&2; exit 1; fi; \
	}
	@touch $@

# ---------------------------------------------------------------------------------------------------- maintenance
# Run by a maintainer with pip-tools at hand. No index address gets into the locks.
COMPILE := pip-compile --quiet --upgrade --generate-hashes --allow-unsafe --strip-extras \
	--no-emit-index-url --no-emit-find-links --no-emit-trusted-host --no-header
# pip-tools lists this project too, because some extras name others of it.
OURS := -e '/^\# WARNING: pip install/d' -e '/^\# Consider using a hashable/d' -e '/^arcor2-hw @ /,+1d'
lock:
	$(COMPILE) $(EXTRAS) --extra build --extra dev --output-file requirements/dev.txt pyproject.toml
	$(COMPILE) $(EXTRAS) --extra build --constraint requirements/dev.txt --output-file requirements/run.txt pyproject.toml
	sed -i $(OURS) requirements/dev.txt requirements/run.txt
	echo cyclonedx-bom | $(COMPILE) --constraint requirements/dev.txt --output-file requirements/release.txt -
	echo cosmic-ray | $(COMPILE) --constraint requirements/dev.txt --output-file requirements/mutation.txt -

clean:
	rm -rf dist $(VENV) .make editor/node_modules server/arcor2_server/editor_files .mypy_cache .ruff_cache .pytest_cache

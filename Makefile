# Everything a developer or a newcomer runs; `make help` lists it. Needs Python 3.11 or newer.

SHELL := bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.ONESHELL:

VENV ?= .venv
BIN := $(VENV)/bin
CORE := $(VENV)/.core
READY := $(VENV)/.ready
COVERAGE_READY := $(VENV)/.coverage_ready
PACKAGES := rover_physics msg_adapters rover_planner
MAP ?=
TESTS ?= test
# One more than there are cores: many tests wait for a rover that drives.
WORKERS ?= $(shell echo $$(( $$(nproc) + 1 )))
# A test that hangs fails, as does a stage that does not end: each says where.
END_HANGS := --override-ini faulthandler_exit_on_timeout=true
LIMIT := timeout --foreground --signal INT --kill-after 60 2700
TIMED_TESTS := $(shell grep -rl mark.timed test --include="test_*.py")
# Tests, demo and nodes talk to this machine only.
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# Demo, nodes and tests start some hundred processes: none of them compiles again what one has compiled.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help
help: ## list what there is
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## (.*)/make \1\t\2/' | expand -t 18

.PHONY: demo
demo: $(READY) ## plan over DDS on a made Mars terrain; MAP=spirit for Mars, MAP=file.npz for another
	@$(BIN)/python -m rover_planner demo $(if $(MAP),--map "$(MAP)")

.PHONY: view
view: $(READY) kernels ## watch the rover on a terrain in a web page; MAP as for demo
	@$(BIN)/python -m rover_planner view lsr1 $(if $(MAP),"$(MAP)")

.PHONY: test
test: $(CORE) ## lint, type check and all tests
	@$(MAKE) --no-print-directory --jobs 2 --output-sync kernels lint collected
	run() { # a second run of what fails tells whether it needs other tests to fail; it mends nothing
	  echo "== $$1"; shift
	  $(LIMIT) $(BIN)/python -m pytest $(END_HANGS) --durations 25 --durations-min 10 --cache-clear "$$@" && return
	  echo "== what failed, once more and alone, to tell more; the run has failed"
	  $(LIMIT) $(BIN)/python -m pytest $(END_HANGS) "$$@" --numprocesses 0 --last-failed --last-failed-no-failures none || true
	  return 1
	}
	failed=0
	run "tests" --numprocesses $(WORKERS) --dist loadfile --no-loadscope-reorder \
	  -m "not timed and not long" test || failed=1
	run "tests that bound a time by the clock, one after another" \
	  -m "timed and not long" $(TIMED_TESTS) || failed=1
	exit $$failed

.PHONY: test-long
test-long: $(READY) kernels ## the tests that take long: lowest versions, killed workers, long drives, every page of the docs
	@$(LIMIT) $(BIN)/python -m pytest $(END_HANGS) --durations 25 -m long test

.PHONY: quick
quick: $(READY) ## the tests that are not slow: under a minute once the kernels are compiled
	@$(BIN)/python -m pytest -q -n auto --dist loadfile -m "not slow and not timed and not long" test

.PHONY: coverage
coverage: $(COVERAGE_READY) kernels ## share of the lines that tests run, compiled kernels left out; TESTS=test/messages for a part
	@$(BIN)/python -m pytest -q -n $(WORKERS) --dist loadfile -m "not timed and not long" \
	  --cov --cov-report term:skip-covered $(TESTS)

.PHONY: lint
lint: $(READY) ## ruff, mypy, and oxlint for the page
	@echo "== ruff"
	$(BIN)/python -m ruff check .
	echo "== oxlint"
	$(BIN)/oxlint --deny-warnings rover_planner/viewer/front
	echo "== mypy"
	$(BIN)/python -m mypy

.PHONY: collected
collected: $(READY) # no worker prepares again what one has
	@echo "== collecting the tests"
	$(BIN)/python -m pytest -qq --collect-only test | tail -n 3

.PHONY: kernels
kernels: $(CORE) ## compile the numba kernels into their cache
	@echo "== compiling kernels"
	$(BIN)/python -m rover_planner warm-up

.PHONY: bench
bench: $(READY) kernels ## measure times and memory, as a table and bench_output/results.json
	@$(BIN)/python -m benchmarks.run

.PHONY: clean
clean: ## remove the environment and everything that was made
	rm -rf "$(VENV)" build dist install log demo_output bench_output *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find $(PACKAGES) test -name __pycache__ -prune -exec rm -rf {} +

# Kernels compile while the extras are installed.
$(CORE): setup.py pyproject.toml constraints.txt .ci/make_venv
	@.ci/make_venv "$(VENV)"
	touch $@

$(READY): $(CORE)
	@.ci/make_venv "$(VENV)" extras
	touch $@

# Numba imports coverage where it is: each process of the tests would take a tenth of a second longer to start.
$(COVERAGE_READY): $(READY)
	@echo "== coverage"
	$(BIN)/python -m pip install -qq --no-input -c "$(VENV)/constraints.txt" --no-build-isolation --editable ".[coverage]"
	touch $@

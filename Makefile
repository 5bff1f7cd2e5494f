# Every target sets up what it needs: a virtual environment in .venv.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
VENV := .venv
BIN := $(VENV)/bin
TESTS ?=

.DEFAULT_GOAL := help
.PHONY: help setup demo test test-fast test-slow check format fix lint types layers \
        kernels examples bench docs clean

help: ## list the targets
	@grep -hE '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | \
	  awk -F ':.*## ' '{printf "  make %-10s %s\n", $$1, $$2}'

$(VENV)/.run: pyproject.toml
	@test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(VENV)/.dev: $(VENV)/.run
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

$(VENV)/.bench: $(VENV)/.dev
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev,bench]'
	@touch $@

setup: $(VENV)/.dev ## make the virtual environment with all tools

demo: $(VENV)/.run ## judge a mixed fleet over zenoh; pictures in demo-output/
	$(BIN)/omniplan demo

test: $(VENV)/.dev ## all checks and tests but the slow ones; what CI runs
	$(MAKE) --no-print-directory check

check: $(VENV)/.dev lint ## format, lint, types, layers, examples, tests
	$(MAKE) --no-print-directory --jobs 2 --output-sync=target types layers kernels
	$(MAKE) --no-print-directory examples
	$(BIN)/python -m pytest -m "not slow" -n 2 $(TESTS)

test-fast: $(VENV)/.dev ## unit tests only
	$(BIN)/python -m pytest -m "not slow" tests/unit $(TESTS)

test-slow: $(VENV)/.dev ## long soundness runs
	$(BIN)/python -m pytest -m "slow or hypothesis" --hypothesis-profile default \
	  --timeout 3600 $(TESTS)

format fix: $(VENV)/.dev ## format and mend what the linter can
	$(BIN)/ruff check --quiet --fix . ; $(BIN)/ruff format .

lint: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .

types: $(VENV)/.dev
	$(BIN)/mypy

layers: $(VENV)/.dev
	$(BIN)/lint-imports

# Or each of the tests' processes compiles them for itself.
kernels: $(VENV)/.dev
	$(BIN)/python -c "import configspace as c, services.operating.launch as s; s.warm_up([c.build_space(c.load_vehicle(n)) for n in ('mecanum', 'ackermann')])"

examples: $(VENV)/.dev ## run every example
	@for example in examples/*.py; do \
	  echo "$$example"; $(BIN)/python -W error $$example > /dev/null || exit 1; done
	@git diff --exit-code --stat -- examples/manoeuvres

bench: $(VENV)/.bench ## measure; see benchmarks/README.md
	$(BIN)/python -m pytest benchmarks -o python_files="bench_*.py" --benchmark-only

docs: $(VENV)/.dev ## draw the figures of docs/
	$(BIN)/python docs/make_figures.py

clean: ## remove the virtual environment and all caches
	rm -rf $(VENV) .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache demo-output

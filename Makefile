# fieldkit: `make help` lists the targets. PYTHON chooses the Python that makes .venv.
.DEFAULT_GOAL := help
SHELL := /bin/bash
BIN := .venv/bin
STAMP := .venv/.installed
PAGE := fieldkit/report/html
VIEWER := $(PAGE)/vendor/viewer.min.js
PYTEST_ARGS ?=

.PHONY: help setup browser demo test test-all soak fuzz check wheel bench docs clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: $(STAMP) $(VIEWER) ## make .venv, install fieldkit and check the system libraries
	@$(BIN)/python scripts/system_libraries.py --install

$(STAMP): pyproject.toml constraints.txt scripts/make_venv.sh
	@scripts/make_venv.sh .venv
	@touch $@

$(VIEWER): scripts/build_viewer.sh $(wildcard $(PAGE)/web/*.js $(PAGE)/web/*.json) $(PAGE)/web/.npmrc
	@scripts/build_viewer.sh --if-possible

browser: $(STAMP)
	@$(BIN)/python scripts/system_libraries.py --install --tests

demo: setup ## run the whole loop on two small simulated plots, in demo-output/
	$(BIN)/fieldkit demo -o demo-output --overwrite --workers 2

test: setup browser ## run the tests that take less than ten seconds each
	PYTHONDONTWRITEBYTECODE= $(BIN)/pytest -m "not slow" -n auto --dist loadfile $(PYTEST_ARGS)

test-all: setup browser ## run all tests, with more examples
	HYPOTHESIS_PROFILE=thorough $(BIN)/pytest $(PYTEST_ARGS)

soak: setup ## kill 200 runs, fill disks, crash workers (hours; KILLS=20 for fewer)
	$(BIN)/python scripts/soak.py --kills $(or $(KILLS),200)

fuzz: setup ## read changed files of every kind, an hour a family (SECONDS_EACH=240 for less)
	$(BIN)/python scripts/fuzz.py --seconds $(or $(SECONDS_EACH),3600)

check: $(STAMP) ## lint, check the format, the types, which way imports run, and the budget
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-logo
	$(BIN)/python scripts/budget.py
	$(BIN)/python scripts/constants.py fieldkit sim

wheel: setup ## build the wheel, which holds everything, into dist/
	$(BIN)/python -m hatchling build -t wheel

bench: setup ## measure the engine's speed
	$(BIN)/python -m benchmarks engine --overwrite

docs: $(STAMP) ## write the documentation as a site to site/
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

clean: ## remove what the other targets wrote, except .venv
	rm -rf demo-output build dist site $(PAGE)/vendor .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find fieldkit benchmarks tests -name __pycache__ -type d -prune -exec rm -rf {} +

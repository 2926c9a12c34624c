# fieldkit: `make help` lists the targets. PYTHON chooses the Python that makes .venv.
.DEFAULT_GOAL := help
SHELL := /bin/bash
BIN := .venv/bin
STAMP := .venv/.installed
PYTEST_ARGS ?=

.PHONY: help setup demo test test-all check bench clean

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup: $(STAMP) ## make .venv, install fieldkit and check the system libraries
	@$(BIN)/python scripts/system_libraries.py --install

$(STAMP): pyproject.toml constraints.txt scripts/make_venv.sh
	@scripts/make_venv.sh .venv
	@touch $@

demo: setup ## build and score a small rendered example in demo-output/
	$(BIN)/fieldkit demo -o demo-output --overwrite

test: setup ## run the tests that take less than ten seconds each
	$(BIN)/pytest -m "not slow" -n auto --dist loadfile $(PYTEST_ARGS)

test-all: setup ## run all tests
	$(BIN)/pytest $(PYTEST_ARGS)

check: $(STAMP) ## lint, check the format and the types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: setup ## measure the engine's speed
	$(BIN)/fieldkit benchmark engine --overwrite

clean: ## remove what the other targets wrote, except .venv
	rm -rf demo-output build dist .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find fieldkit tests -name __pycache__ -type d -prune -exec rm -rf {} +

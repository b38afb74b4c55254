# make demo: the main job, end to end.   make test: lint and types, and beside them every part once (make quick).
# make test-long: the tests of some seconds each, more shells, more options, every example of a docstring.
# make slow, make bench: minutes each.
# make test-apart: the tests that need a browser, a database server, or execute notebooks that `make docs` has not.
# make docs: notebooks and pages executed, where they changed, and built into out/docs.   make release: built and tried.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed

.PHONY: demo test quick test-long test-apart lint slow bench docs release clean

demo: $(STAMP)
	$(BIN)/jshell demo --out out/demo

test: $(STAMP)
	$(MAKE) --no-print-directory --jobs 2 lint quick

quick: $(STAMP)
	$(BIN)/python -m pytest -n 2 --dist worksteal

test-long: $(STAMP)
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "long and not slow and not apart"

test-apart: $(STAMP)
	$(BIN)/python -m pytest -n 2 --dist worksteal -m "apart and not slow"

lint: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/pyright

slow: $(STAMP)
	$(BIN)/python -m pytest -m slow -o faulthandler_timeout=0

bench: $(STAMP)
	$(BIN)/python benchmarks/trace.py
	$(BIN)/python benchmarks/convergence.py
	$(BIN)/python benchmarks/fits.py
	$(BIN)/python benchmarks/oscillator.py
	$(BIN)/python benchmarks/reading.py
	$(BIN)/python benchmarks/service.py
	$(BIN)/python benchmarks/gpu.py --small

docs: $(STAMP)
	$(BIN)/python docs/execute.py
	$(BIN)/python -m sphinx -q -W --keep-going -b html docs out/docs

release: $(STAMP)
	$(BIN)/python .ci/release.py

$(STAMP): pyproject.toml constraints.txt
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --quiet --constraint constraints.txt --editable '.[dev]'
	touch $(STAMP)

clean:
	rm -rf $(VENV) .programs out build dist

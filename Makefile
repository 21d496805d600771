# Everything here sets itself up: on a fresh machine Python 3.11 or newer and make are enough.
PYTHON ?= python3
BIN := .venv/bin
PIP := $(BIN)/pip install --quiet --disable-pip-version-check
DEMO_RUN := runs/demo

TORCH ?= torch==2.13.0
# In CI the machine's own package sources decide.
ifndef CI
TORCH_INDEX ?= --index-url https://download.pytorch.org/whl/cpu
endif

.PHONY: demo test lint slow docs clean

demo: .venv/.run
	rm -rf $(DEMO_RUN)
	$(BIN)/seqsearch run demo --seed 1 --out $(DEMO_RUN)
	$(BIN)/seqsearch verify $(DEMO_RUN)

test: lint
	$(BIN)/pytest -q -m "not slow" -n 2 --dist loadfile

slow: .venv/.dev
	$(BIN)/pytest -q -m slow

lint: .venv/.dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: .venv/.dev
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo "open build/site/index.html"

clean:
	rm -rf .venv build *.egg-info

.venv/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
		|| { echo "Python 3.11 or newer is needed; try: make PYTHON=python3.12 $(MAKECMDGOALS)"; exit 1; }
	$(PYTHON) -m venv .venv

.venv/.run: pyproject.toml | .venv/bin/python
	$(PIP) -e .
	touch $@

# PyPI's torch for Linux brings gigabytes of CUDA libraries: the CPU build is asked for first.
.venv/.torch: | .venv/bin/python
	$(PIP) --retries 0 --timeout 10 $(TORCH_INDEX) $(TORCH) 2>/dev/null || $(PIP) $(TORCH)
	touch $@

.venv/.dev: pyproject.toml | .venv/.torch
	$(PIP) -e ".[dev,train]"
	touch $@ .venv/.run

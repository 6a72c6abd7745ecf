# make                     the locked environment in .venv, then the full study
# make resume              the same after an interruption: simulations go on from their last checkpoints
# make STUDY=my-hopper     the study in another directory, with a config.yaml of its own; also with resume
# make report              the study on one page, results/report.html, and what it needs; make writes it as well
# make setup               the environment alone; make cluster: and Snakemake's plugin for Slurm
# make test, make lint     in the same environment: the tests; style and the boundaries between modules
# make test-all            the tests with the full counts: an hour
# make test-browser        both reports in Debian's Chromium; skipped where that is missing
# make test-cluster        the study on a Slurm cluster of virtual nodes: as root on Debian, an hour
# make validation         the solver against closed forms and other codes: rewrites docs/validation.md; CASE=name for one
# make archive             configuration, lock, data, tables and figures of the study as one zip file
# make reference           config/config.schema.json and docs/configuration.md anew, from the models in hopperopt.config
# make lock                the newest versions of all libraries into requirements.lock
# make PYTHON=python3.12   another Python for the environment;   make CORES=4   fewer cores for the study

CORES ?= all
STUDY ?= .
stamp := .venv/complete
install := .venv/bin/python -m pip install -qq --disable-pip-version-check --no-deps --no-build-isolation
suitable := import ensurepip, sys, venv; sys.exit(sys.implementation.name != "cpython" or not (3, 11) <= sys.version_info < (3, 15))
version = $(shell $(1) -c 'import sys; print(sys.version)' 2>/dev/null)

snakemake = .venv/bin/snakemake --directory '$(STUDY)'
# The lock is held by the shell and then by Snakemake in its place, never by a job: it ends with them, however they end.
define lock_study
@mkdir -p '$(STUDY)/.snakemake' && exec 9> '$(STUDY)/.snakemake/make.lock' || exit 1; \
if ! .venv/bin/python -c 'import sys; from hopperopt import locks; sys.exit(not locks.take(9))'; then \
	echo "another make is at work on this study ($(STUDY)): wait for its end, or stop it first" >&2; exit 1; fi
endef

# Processes begin far apart in the order of the tests, so that those of one file mostly share what they set up, and end
# together: who has nothing left takes tests from another.
pytest = .venv/bin/python -m pytest --numprocesses logical --maxprocesses 8 --dist worksteal

.PHONY: study resume report setup cluster test test-all test-browser test-cluster lint validation archive reference lock
study: setup
	$(lock_study); exec $(snakemake) --cores $(CORES)

resume: setup
	$(lock_study); $(snakemake) --unlock && exec $(snakemake) --cores $(CORES) --rerun-incomplete

report: setup
	$(lock_study); exec $(snakemake) --cores $(CORES) report

setup: $(stamp)

cluster: .venv/cluster

.venv/cluster: requirements-cluster.lock $(stamp)
	$(install) --require-hashes -r requirements-cluster.lock
	touch $@

test: setup
	$(pytest)

test-all: setup
	$(pytest) -m "full or not full"

test-browser: setup
	.venv/bin/python -m pytest -m "full or not full" tests/browser

test-cluster: cluster
	tests/cluster/run.sh

validation: setup
	.venv/bin/python -m validation $(CASE)

archive: setup
	.venv/bin/python -m hopperopt archive --directory '$(STUDY)'

reference: setup
	.venv/bin/python -m hopperopt reference --output config/config.schema.json docs/configuration.md

lint: setup
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/snakefmt --check workflow Snakefile
	.venv/bin/mypy
	.venv/bin/lint-imports

# A Python that is named and is not the environment's makes it anew; without a name the environment stays.
ifdef PYTHON
ifneq ($(call version,$(PYTHON)),$(call version,.venv/bin/python))
.PHONY: $(stamp)
endif
else
PYTHON = $(shell for p in python3.11 python3.12 python3.13 python3.14 python3; do \
	$$p -c '$(suitable)' 2>/dev/null && echo $$p && break; done)
endif

# The stamp comes last: an environment without it is half made and is made anew from nothing.
# The build backend goes in first because a few libraries have no wheel. One of them, immutables, wants a compiler on
# Python 3.14 for an extension that it can do without: with "true" as the compiler it installs without the extension.
$(stamp): requirements.lock pyproject.toml
	@if ! $(PYTHON) -c '$(suitable)' 2>/dev/null; then \
		echo "hopperopt needs CPython 3.11 to 3.14 with venv, and $(if $(PYTHON),$(PYTHON) is not that,none was found)" \
			"(Debian: apt install python3-venv; to choose one: make PYTHON=python3.12)." >&2; exit 1; fi
	$(PYTHON) -m venv --clear .venv
	sed -n '/^setuptools==/,/[^\\]$$/p' requirements.lock > .venv/backend.lock
	$(install) --require-hashes -r .venv/backend.lock
	CC=true LDSHARED=true $(install) --require-hashes -r requirements.lock
	$(install) --editable .
	.venv/bin/python -m pip check
	touch $@

lock:
	set -e; new=$$(mktemp -d); trap 'rm -rf "$$new"' EXIT; cp pyproject.toml "$$new"; \
	$(PYTHON) -m venv "$$new/venv"; "$$new/venv/bin/pip" install --quiet uv; \
	export="$$new/venv/bin/uv export --quiet --project $$new --no-header --no-emit-project"; \
	echo "# Every library in one version for CPython 3.11 to 3.14, with the hashes of its files. Made by: make lock" > "$$new/lock"; \
	echo "# Snakemake's plugin for Slurm and what it needs, in the versions of requirements.lock. Made by: make lock" > "$$new/cluster"; \
	$$export --all-extras --group build >> "$$new/lock"; $$export --only-group cluster >> "$$new/cluster"; \
	cp "$$new/lock" requirements.lock; cp "$$new/cluster" requirements-cluster.lock

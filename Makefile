# make fly    install into .venv, fly the demonstration missions, leave logs/<UTC>/flight.mcap and report.html
# make test   everything a change must pass: lint, types, all tests in parallel
# make bench  accuracy and speed tables (minutes)
# make gallery  docs/gallery.md: what each pattern sees
# make docs   the pages of docs/ as a site, build/site/index.html
# make interop  MAVProxy and Rerun, in an environment of their own (1.9 GB), with what we fly and write
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
RECORDING := ../shared/data/spot_bilayer_a.npz
WORKERS ?= auto

.PHONY: fly test lint bench gallery docs interop schemas clean

fly: $(VENV)/installed
	$(BIN)/dslam-mav fly --sources 3 --ambient auto
	@echo
	@if [ -f $(RECORDING) ]; then $(BIN)/dslam-mav fly --readings $(RECORDING) --sources 2; \
	else echo "second flight, over recorded diffusion: skipped, $(RECORDING) is missing"; fi

test: $(VENV)/installed-dev lint
	$(BIN)/python -m pytest -n $(WORKERS)

lint: $(VENV)/installed-dev
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

bench: $(VENV)/installed-dev
	$(BIN)/python -m tests.bench
	$(BIN)/python -m tests.bench.counting
	$(BIN)/python -m tests.bench.speed
	$(BIN)/python -m tests.bench.throughput --speedup 4
	$(BIN)/python -m tests.bench.replay_hour
	$(BIN)/python -m tests.bench.sweeping
	$(BIN)/python -m tests.bench.plans
	$(BIN)/python -m tests.bench.recorded_fields
	$(BIN)/python -m tests.bench.recorded
	$(BIN)/python -m tests.bench.flights
	$(BIN)/python -m tests.bench.hover
	$(BIN)/python -m tests.bench.accelerations

# What each pattern sees: docs/gallery.md and its pictures (two minutes).
gallery: $(VENV)/installed-dev
	$(BIN)/python -m dslam_mav.commands.gallery docs

docs: $(VENV)/installed-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo build/site/index.html

interop: $(VENV)/installed-dev build/interop/installed
	$(BIN)/python -m tests.interop

build/interop/installed:
	$(PYTHON) -m venv build/interop
	build/interop/bin/python -m pip install --quiet --disable-pip-version-check \
		'MAVProxy>=1.8.74,<1.9' 'rerun-sdk>=0.30,<1'
	@touch $@

# The generated schemas are kept in the repository; this makes them anew, with a compiler whose code every allowed
# protobuf runtime accepts, in an environment of its own.
schemas:
	$(PYTHON) -m venv build/protoc
	build/protoc/bin/python -m pip install --quiet 'grpcio-tools==1.74.*'
	build/protoc/bin/python -m grpc_tools.protoc -I. --python_out=. --pyi_out=. dslam_mav/log/schemas/flight.proto
	sed -i '1i # mypy: disable-error-code="type-arg"' dslam_mav/log/schemas/flight_pb2.pyi

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	{ echo "dslam_mav needs Python 3.11 or newer, $(PYTHON) is $$($(PYTHON) --version): make PYTHON=python3.12 ..."; exit 1; }
	$(PYTHON) -m venv $(VENV)

# The kernels are compiled here once, so that the first flight need not wait for them.
$(VENV)/installed: pyproject.toml | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	$(BIN)/python -c 'from dslam_mav.dslam.warm import warm_up; warm_up()'
	@touch $@

$(VENV)/installed-dev: pyproject.toml $(VENV)/installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@

$(VENV)/installed-docs: pyproject.toml $(VENV)/installed
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	@touch $@

clean:
	rm -rf $(VENV) build dist *.egg-info .pytest_cache .mypy_cache .ruff_cache

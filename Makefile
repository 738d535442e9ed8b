# make setup | demo | check | test | soak | firmware | board | docs | fresh
# Each target installs only what it needs, and only once. Another Python: make check PYTHON=python3.13 VENV=.venv313

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
export PIP_CONSTRAINT := $(CURDIR)/constraints.txt
export PIP_DISABLE_PIP_VERSION_CHECK := 1
# tests spend half their time waiting, so files run in parallel; the slowest, wheel and notebook, start first
AT_ONCE := --dist loadfile --no-loadscope-reorder --max-worker-restart 0
# -noreset: otherwise the X server resets when its last window closes, and rejects connections meanwhile
IN_XVFB := xvfb-run --auto-servernum --server-args='-screen 0 1920x1080x24 -noreset'
# keyboard focus cannot be shared, so each process has its own X server
TWO_SCREENS := --tx "2*popen//python=$(IN_XVFB) $(BIN)/python"

.PHONY: setup tools demo check lint test soak firmware board docs fresh clean

# the product alone; `tools` adds the development tools
setup: $(VENV)/installed

tools: $(VENV)/tools

$(VENV)/installed: pyproject.toml setup.py constraints.txt setup/debian_packages.sh
	setup/debian_packages.sh demo
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

$(VENV)/tools: $(VENV)/installed
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	touch $@

# with a window if there is a display; otherwise writes the same results to demo-result/
demo: setup
	$(BIN)/sonarhw demo

# the firmware and the emulated board
firmware:
	setup/debian_packages.sh firmware
	$(MAKE) --no-print-directory -C firmware WERROR=-Werror all emulator host

# the emulated board in the demo room; its first line of output is its URL; Ctrl-C ends it
board: setup firmware
	$(BIN)/sonarhw board

# lint, import layers, types, and the tests without ports, processes and windows
check: lint
	$(BIN)/pytest tests/unit $(AT_ONCE) --numprocesses 2

lint: tools
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/mypy

test: lint firmware
	setup/debian_packages.sh test
	$(BIN)/pytest tests/system/gui $(AT_ONCE) $(TWO_SCREENS)
	$(IN_XVFB) $(BIN)/pytest tests --ignore tests/system/gui $(AT_ONCE) --numprocesses 3 --cov

# long tests and benchmarks; takes some hours
soak: tools firmware
	setup/debian_packages.sh test soak
	$(MAKE) --no-print-directory -C firmware build/libfuzzer
	firmware/build/libfuzzer -max_total_time=3600 -max_len=600
	$(BIN)/pytest tests/soak tests/system/firmware/test_fuzz.py tests/system/firmware/test_long.py --soak --timeout 36000
	$(BIN)/python -m benchmarks.wire
	$(BIN)/python -m benchmarks.live 600
	$(BIN)/python -m benchmarks.window --full

# the documentation site, in build/site; fails on a broken link
docs: setup
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --quiet

# make demo and test on a new Debian 12; needs root and debootstrap. Other targets: FRESH="demo check"
fresh:
	setup/fresh_machine.sh $(FRESH)

clean:
	rm -rf $(VENV) build dist *.egg-info demo-result firmware/build

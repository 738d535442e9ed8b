# make setup | demo | check | test | coverage | soak | mutation | firmware | board | docs | fresh | lock | audit
# Each target installs only what it needs, and only once. Another Python: make check PYTHON=python3.13 VENV=.venv313

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
SEED ?= 1
SAMPLE ?= 100
export PIP_DISABLE_PIP_VERSION_CHECK := 1
SHELL := /bin/bash
.SHELLFLAGS := -o pipefail -c
# some container images set it: then each process of the tests compiles all modules again
unexport PYTHONDONTWRITEBYTECODE
# pip uses the index of its settings and the certificates of the system; uv has to be told both
export UV_SYSTEM_CERTS := 1
FROM_INDEX = index=$${PIP_INDEX_URL:-$$($(BIN)/pip config get global.index-url 2>/dev/null)}; \
	[ -z "$$index" ] || export UV_DEFAULT_INDEX="$$index";
# versions and hashes are locked, and packages build with the locked setuptools. A lock is complete, so nothing else is
# installed. uv needs a fifth of pip's processor time; pip installs the same files where uv fails, as behind some proxies
install = $(FROM_INDEX) $(BIN)/uv pip install --python $(BIN)/python --no-build-isolation --no-deps $(1) || \
	{ echo "uv cannot install here; pip installs the same packages, which takes longer" >&2; \
	$(BIN)/pip install --no-compile --no-build-isolation --no-deps --progress-bar off $(1); }
locked = $(call install,--require-hashes $(patsubst %,--requirement requirements/%.txt,$(1)))
# many tests wait, so more files run in parallel than there are cores; small files of unit tests are last
AT_ONCE := --dist loadfile --no-loadscope-reorder --max-worker-restart 0
# of window tests, files with more tests come first, so that both processes end at about the same time
WINDOWS_AT_ONCE := --dist loadfile --max-worker-restart 0
# -noreset: otherwise the X server resets when its last window closes, and rejects connections meanwhile
IN_XVFB := xvfb-run --auto-servernum --server-args='-screen 0 1920x1080x24 -noreset'
# keyboard focus cannot be shared, so each process has its own X server
TWO_SCREENS := --tx "2*popen//python=$(IN_XVFB) $(BIN)/python"
WITHOUT_WINDOW := tests --ignore tests/system/gui
# what depends on the system: files, ports, processes, signals. Without the modules that they import, a first run takes a
# fifth of the time; the errors left out follow from their missing types, and the run for Linux reports them
OF_THE_SYSTEM := --package sonarhw --package sonarhw_cli --module sonarhw_sim.compiled \
	--module sonarhw_compare.processes --module sonarhw_gui.window.start --module sonarhw_gui.window.display \
	--follow-imports skip $(patsubst %,--disable-error-code %,misc no-any-return untyped-decorator unused-ignore var-annotated)

# OpenBLAS threads wait in a loop for each other, and processes of the tests already use all cores
check window-tests other-tests coverage: export OPENBLAS_NUM_THREADS := 1

.PHONY: setup tools demo check lint types types-in-test test collected window-tests other-tests coverage soak mutation firmware board docs fresh lock audit clean

# the product with its window; `tools` adds the development tools
setup: $(VENV)/installed $(VENV)/compiled

tools: $(VENV)/tools $(VENV)/compiled

$(VENV)/installed: pyproject.toml setup.py requirements/install.txt requirements/build.txt requirements/base.txt requirements/gui.txt setup/debian_packages.sh
	setup/debian_packages.sh demo
	@echo "Installing Python packages (0.9 GB) into $(VENV)"
	$(PYTHON) -m venv $(VENV)
	$(BIN)/pip install --quiet --no-compile --no-deps --require-hashes --requirement requirements/install.txt
	@$(call locked,build)
	@$(call locked,base gui)
	@$(call install,--quiet --editable .)
	touch $@

# apart, so that `make test` compiles while it installs the tools
$(VENV)/compiled: $(VENV)/installed
	@echo "Compiling predictions, fits and searches, once per installation"
	$(BIN)/python setup/compile_kernels.py
	touch $@

$(VENV)/compiled_for_demo: $(VENV)/installed
	@echo "Compiling the prediction of the demo, once per installation"
	$(BIN)/python setup/compile_kernels.py demo
	touch $@

$(VENV)/tools: $(VENV)/installed requirements/foxglove.txt requirements/rooms.txt requirements/ros.txt requirements/study.txt requirements/video.txt requirements/dev.txt
	@echo "Installing development tools into $(VENV)"
	@$(call locked,base foxglove gui rooms ros study video dev)
	$(BIN)/python -m pip check
	touch $@

# with a window if there is a display; otherwise writes the same results to a new folder. What only fits and searches
# need is compiled meanwhile
demo: $(VENV)/installed $(VENV)/compiled_for_demo
	@{ [ $(VENV)/compiled -nt $(VENV)/installed ] || \
		{ nice $(BIN)/python setup/compile_kernels.py && touch $(VENV)/compiled; }; } >/dev/null 2>&1 &
	$(BIN)/sonarhw demo

# the firmware and the emulated board
firmware:
	setup/debian_packages.sh firmware
	$(MAKE) --no-print-directory -C firmware WERROR=-Werror combinations emulator host

# builds the emulated board, runs it in the demo room and prints its URL; Ctrl-C ends it
board: setup firmware
	$(BIN)/sonarhw board

# lint, import layers, types, and the tests without ports, processes and windows
check: lint types $(VENV)/compiled
	$(BIN)/pytest tests/unit $(AT_ONCE) --numprocesses 2

lint: $(VENV)/tools
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/lint-imports
	$(BIN)/typos

types: $(VENV)/tools
	$(BIN)/mypy
	$(BIN)/mypy --platform win32 --cache-dir .mypy_cache/win32
	$(BIN)/mypy --platform darwin --cache-dir .mypy_cache/darwin

types-in-test: $(VENV)/tools
	$(BIN)/mypy
	$(BIN)/mypy --platform win32 --cache-dir .mypy_cache/part_of_win32 $(OF_THE_SYSTEM)
	$(BIN)/mypy --platform darwin --cache-dir .mypy_cache/part_of_darwin $(OF_THE_SYSTEM)

# Debian packages first: two jobs cannot install at once. mypy needs half a minute; it runs beside the first tests,
# and window tests follow it, which need less time than the others
test:
	@mkdir -p build && date +%s >build/test_began
	setup/debian_packages.sh demo firmware test
	$(MAKE) --no-print-directory --jobs 2 --output-sync=target $(VENV)/tools $(VENV)/compiled firmware
	@date +%s >build/test_installed
	$(MAKE) --no-print-directory --jobs 2 --output-sync=target lint collected
	$(MAKE) --no-print-directory --jobs 2 types-in-test other-tests window-tests
	@now=$$(date +%s); echo "make test took $$((now - $$(cat build/test_began))) s," \
		"without installing and compiling $$((now - $$(cat build/test_installed))) s"

# pytest compiles the tests when it collects them; otherwise each of its processes would compile them all
collected: $(VENV)/tools
	@mkdir -p build
	@$(BIN)/pytest tests --collect-only --quiet >build/collected.txt || { tail -n 50 build/collected.txt; exit 1; }

# at the same time as the other tests, because most window tests wait; the results follow at the end
window-tests:
	@mkdir -p build
	@$(BIN)/pytest tests/system/gui --slowest 10 $(WINDOWS_AT_ONCE) $(TWO_SCREENS) >build/window-tests.txt; \
		status=$$?; cat build/window-tests.txt; exit $$status

other-tests:
	$(IN_XVFB) $(BIN)/pytest $(WITHOUT_WINDOW) --slowest 10 $(AT_ONCE) --numprocesses 3

# the tests without windows once more; fails if they execute less than 90 %. Python code runs at half its speed meanwhile
coverage: tools firmware
	setup/debian_packages.sh test
	$(IN_XVFB) $(BIN)/pytest $(WITHOUT_WINDOW) $(AT_ONCE) --numprocesses 3 --cov

# long tests and benchmarks; takes some hours
soak: tools firmware
	setup/debian_packages.sh test soak
	$(MAKE) --no-print-directory -C firmware build/libfuzzer
	firmware/build/libfuzzer -max_total_time=3600 -max_len=600
	$(BIN)/pytest tests/soak tests/system/firmware/test_long.py --soak --timeout 36000
	$(IN_XVFB) $(BIN)/pytest tests -m soak --soak --timeout 36000
	$(IN_XVFB) $(BIN)/pytest tests/system/gui/test_monkey.py --soak --timeout 36000
	$(BIN)/python -m benchmarks.wire
	$(BIN)/python -m benchmarks.live 600
	$(BIN)/python -m benchmarks.window --full
	$(MAKE) --no-print-directory mutation

# change the code in random places, and print the changes that no test detects; another sample: SEED=2
mutation: tools
	$(BIN)/python -m tests.mutation --sample $(SAMPLE) --seed $(SEED) --recorded build/mutation --least 0.85

# the documentation site, in build/site; fails on a broken link
docs: setup
	@$(call locked,base gui docs)
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build # with --quiet, mkdocs counts no warnings

# make demo and test on a new Debian 12; needs root and debootstrap. Other targets: FRESH="demo check"
fresh:
	setup/fresh_machine.sh $(FRESH)

# lock versions and hashes after a change of pyproject.toml; all newest versions: make lock UPGRADE=--upgrade
lock: setup
	@$(call locked,base audit)
	PATH="$(abspath $(BIN)):$$PATH" $(BIN)/python -m requirements.lock $(UPGRADE)

# known vulnerabilities and abandoned dependencies; checks what it can without network
audit: setup
	@$(call locked,base audit)
	PATH="$(abspath $(BIN)):$$PATH" $(BIN)/python -m requirements.audit

clean:
	rm -rf $(VENV) build dist *.egg-info demo-result firmware/build

# Everything the project does, from a fresh clone on a machine with Python >= 3.11 and a Rust toolchain.
# `make demo` and `make test` are the two that matter; each does all set-up itself, in .venv.

PYTHON ?= python3
OUT    ?= out
# On Windows make is run from Git's shell, and programs end with .exe.
BIN    := .venv/$(if $(filter Windows_NT,$(OS)),Scripts,bin)
EXE    := $(if $(filter Windows_NT,$(OS)),.exe)
# The tools of development have the same versions everywhere; `make pins` brings them up to date.
PINS   := .ci/constraints.txt
PIP    := $(BIN)/pip install --quiet --disable-pip-version-check --constraint $(PINS)
UV     := $(BIN)/uv pip install --quiet --python .venv/oldest
# Tests run compilers, which would look for the jobs of this make.
PYTHON_TEST := env -u MAKEFLAGS -u MFLAGS $(BIN)/python -m pytest -q
# On every core; a file stays on one, for its tests share what takes time to make. The longest begin first: tests/support/durations.py.
PYTEST := $(PYTHON_TEST) -n auto --dist loadfile --no-loadscope-reorder
# How soon Ctrl-C ends a run is timed alone, when all others are done, and not from a shell's background, where Ctrl-C is ignored.
ALONE := tests/runs/test_interrupt.py
SOURCES := $(shell find rust python -type f \( -name "*.rs" -o -name "*.toml" -o -name "*.py" -o -name "*.pyi" -o -name py.typed \)) \
           Cargo.toml Cargo.lock pyproject.toml README.md LICENSE THIRD-PARTY.txt

# Files that build.rs finds, so that cargo does not tell rustfmt of them.
LISTED := $(shell find rust/core/src/model/steppers rust/core/src/model/systems -name "*.rs")

# Which wheels `make wheels` builds, by the names in .ci/build_wheels.py; all if none is named.
WHEELS ?=

# Windows: the target of its builds, and a folder of their own, so that they wait for no other.
WINDOWS := x86_64-pc-windows-gnu
BUILT_FOR_WINDOWS := $(CURDIR)/target/windows
IN_WINE := env -u STEPWELL_TESTS WINEPREFIX=$(CURDIR)/.venv/wine WINEDEBUG=-all WINEDLLOVERRIDES=mscoree,mshtml= \
           OPENBLAS_NUM_THREADS=1 CARGO_TARGET_DIR=$(BUILT_FOR_WINDOWS) \
           CARGO_TARGET_X86_64_PC_WINDOWS_GNU_RUNNER="$(CURDIR)/$(BIN)/python $(CURDIR)/tests/windows/piped.py"
# What is tested by an interpreter for Windows: the bits, files, the console, Ctrl-C. How long writing a kernel takes is not: other
# tests run meanwhile.
TESTS_ON_WINDOWS := windows recorded_bits kernels fixed saved_runs output cli interrupt package

.DEFAULT_GOAL := help
.PHONY: help demo docs test test-outer test-all test-long test-wheels test-oldest test-aarch64 test-windows campaign wheel wheels release deny
.PHONY: licences dev bench gate format pins clean hooks lint lint-rust lint-python lint-outer check-rust check-python check-budget check-workflows
.PHONY: rust-build rust-test python-test python-outer durations

help: ## list the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-12s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

demo: $(BIN)/python$(EXE) ## set up, build, and chart error against cost for two scenes into out/
	@$(MAKE) --no-print-directory -j2 .venv/demo
	$(BIN)/stepwell chart oscillator clover -o $(OUT)

docs: .venv/docs ## build the site into out/docs, without a network; a warning is an error
	$(BIN)/sphinx-build -n -W --keep-going -q docs $(OUT)/docs
	@echo "open $(OUT)/docs/index.html"

test: ## set up, and run the everyday tests: Rust, Python, examples, docs, formatting, lints, types
	$(MAKE) --no-print-directory -j2 lint rust-test python-test
	$(PYTHON_TEST) $(ALONE)
	$(BIN)/python .ci/budget.py suite

test-outer: ## run the tests that wait for other programs: site, browser, devices, other languages, benches, AArch64, Windows, a build of its own
	$(MAKE) --no-print-directory -j2 lint-outer python-outer $(OUTER)

# Both are left out where their tools are not there; CI has them.
OUTER = $(if $(shell command -v qemu-aarch64),test-aarch64) $(if $(shell command -v wine),test-windows)

test-all: test test-outer ## run both, as CI does

wheel: .venv/wheel ## build the release wheel into dist/
	@ls -l dist/*.whl

release: .venv/release .venv/wheels ## build all wheels and the sdist into dist/release/, check all, install and try what runs here
	rm -rf dist/release
	$(BIN)/maturin sdist --out dist/release
	cp dist/wheels/*.whl dist/release
	$(BIN)/twine check --strict dist/release/*
	$(BIN)/python tests/wheels.py dist/release
	$(BIN)/python tests/installed.py dist/release dist/release/*.tar.gz
	@ls -l dist/release
	@echo "ready: $(BIN)/twine upload dist/release/*"

wheels: .venv/wheels ## build the release wheels for Linux, macOS and Windows, on x86-64 and ARM, into dist/wheels/ (WHEELS="name ...": only these)
	@ls -l dist/wheels/*.whl

test-wheels: .venv/wheels ## build them, check them, and try this machine's in a clean environment
	$(BIN)/python tests/wheels.py dist/wheels
	$(BIN)/python tests/installed.py dist/wheels

# Of a wheel only the wheel itself is direct: its needs are named here. Old packages use what newer ones below them call deprecated. The extra sweep is left out: of what it installs the oldest versions that go together need NumPy 2.
OLDEST := chart gym progress tables zarr
RUST   := $(shell sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
test-oldest: .venv/uv .venv/wheel ## build the core with the oldest Rust, and run the tests with the oldest NumPy and other packages, of Cargo.toml and pyproject.toml
	rustup toolchain install --profile minimal $(RUST)
	cargo +$(RUST) check --workspace --locked
	$(BIN)/uv venv --quiet --clear --python $(BIN)/python .venv/oldest
	$(UV) --resolution lowest-direct -r pyproject.toml $(OLDEST:%=--extra %)
	$(UV) --no-deps dist/*.whl
	$(BIN)/uv pip freeze --python .venv/oldest > .venv/oldest.txt
	$(UV) --constraint $(PINS) --constraint .venv/oldest.txt pytest pytest-xdist hypothesis mpmath packaging
	$(subst $(BIN)/python,.venv/oldest/bin/python,$(PYTEST)) -W ignore::DeprecationWarning

deny: ## check the licences and sources of the crates, and known faults in them, by deny.toml
	@command -v cargo-deny > /dev/null || cargo install --locked --quiet cargo-deny
	cargo deny --locked check $(DENY)

licences: ## write the licences of the crates in a wheel into THIRD-PARTY.txt
	$(PYTHON) .ci/licences.py

# Recorded bits cover every method, system and form; of the tests of kernels those that start no program and measure no time. The
# folder of its builds is its own, so that they wait for no other.
TESTS_ON_AARCH64 := tests/reference/test_recorded_bits.py tests/reference/test_kernels.py -k "recorded or threads or parent or border"
test-aarch64: .venv/maturin ## run the package's tests of bits, threads and processes on AArch64: a wheel under an emulator
	@for tool in qemu-aarch64 aarch64-linux-gnu-gcc rustup; do command -v $$tool > /dev/null || \
	  { echo "there is no $$tool here: Debian's packages are qemu-user and gcc-aarch64-linux-gnu; rustup is of https://rustup.rs"; exit 1; }; done
	rustup target add aarch64-unknown-linux-gnu
	rm -rf dist/aarch64
	CARGO_TARGET_DIR=$(CURDIR)/target/aarch64 CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc \
	  $(BIN)/maturin build --release --quiet --target aarch64-unknown-linux-gnu --compatibility off --out dist/aarch64
	$(BIN)/python tests/aarch64.py .venv/aarch64 dist/aarch64/*.whl $(TESTS_ON_AARCH64)
	STEPWELL_EMULATED=1000 cargo test --release -p stepwell-core --test aarch64 --quiet

dev: .venv/test ## install in place, for work on the code; run again after a change in rust/
	$(BIN)/maturin develop --release --quiet

hooks: .venv/test ## check format, lints, types and tables before each commit; .pre-commit-config.yaml has the list
	$(PIP) pre-commit
	$(BIN)/pre-commit install

bench: .venv/bench ## time every language on the same work, in half an hour, into benches/RESULTS.md and the docs (BENCH=--quick: two minutes, into out/)
	@$(PIP) numbalsoda 2> /dev/null || echo "numbalsoda is left out: pip builds it, which takes cmake and a Fortran compiler"
	$(BIN)/python -m benches.compare $(BENCH)
	$(BIN)/python -m benches.stiff $(BENCH)
	$(BIN)/python docs/generate.py
	$(BIN)/python docs/speed.py

gate: .venv/bench ## compare ten speeds with C, in a minute; one below 0.9 of benches/gate.json fails
	$(BIN)/python -m benches.gate

# In `make test` two of these run at a time, so that neither core waits for a download or a program that uses only one.
lint: lint-rust lint-python

# After the build, which has both cores already.
lint-rust: rust-build
	@$(MAKE) --no-print-directory check-rust
	cargo clippy --release --workspace --all-targets --quiet -- -D warnings

lint-python: .venv/test
	@$(MAKE) --no-print-directory check-python check-budget
	$(BIN)/python .ci/budget.py built

# What hardly ever changes by a change of the code.
lint-outer: .venv/test
	@$(MAKE) --no-print-directory check-workflows
	$(BIN)/python -m mypy.stubtest stepwell._core --concise
	RUSTDOCFLAGS="-D warnings" cargo doc --release --workspace --no-deps --quiet

# The part of `lint` that needs no build: it reads the sources, not what is installed. The hooks before a commit run it.
check-rust:
	cargo fmt --all --check
	rustfmt --edition 2024 --check $(LISTED)

check-python:
	$(BIN)/ruff format --check --quiet .
	$(BIN)/ruff check --quiet .
	$(BIN)/mypy --no-error-summary
	PYTHONPATH=python $(BIN)/lint-imports --no-cache > .venv/lint-imports.log || { cat .venv/lint-imports.log; exit 1; }

check-budget:
	$(BIN)/python .ci/budget.py lines

check-workflows:
	$(BIN)/zizmor --offline --quiet .github
	$(BIN)/check-jsonschema --quiet --builtin-schema vendor.github-workflows .github/workflows/*.yml
	$(BIN)/check-jsonschema --quiet --builtin-schema vendor.dependabot .github/dependabot.yml

# The wheel comes first: both are built in one folder, and have the core in common.
rust-build: .venv/wheel
	cargo test --release --workspace --quiet --no-run

rust-test: rust-build
	cargo test --release --workspace --quiet

python-test: .venv/test
	$(PYTEST) --ignore=tests/outer --ignore=$(ALONE) --durations-to=.venv/durations.json

python-outer: .venv/test
	$(PYTEST) tests/outer

durations: ## keep how long each file of the last `make test` took, by which the next one on a new machine is ordered
	cp .venv/durations.json .ci/durations.json

test-long: .venv/test ## run what `test` leaves out: every family of tests in full, and mistakes that the tests must notice
	$(PYTEST) --long --durations=20
	STEPWELL_EMULATED=12000 cargo test --release -p stepwell-core --test aarch64 --quiet

test-windows: .venv/windows ## run the Rust tests, and the package's that concern the system, as Windows does: under Wine
	$(IN_WINE) cargo test --release --workspace --quiet --target $(WINDOWS)
	$(IN_WINE) $(BIN)/python tests/windows/piped.py .venv/for-windows/python.exe -m pytest -q -p no:cacheprovider -k "not in_time" $(TESTS_ON_WINDOWS:%=tests/*/test_%.py)

# Each part is tried for a while, and says how often it was and what was found: docs/developing/reliability.md.
CAMPAIGN_SECONDS ?= 600
campaign: .venv/test ## look for faults: fuzzed calls for CAMPAIGN_SECONDS, random systems, memory, threads, processes
	mkdir -p $(OUT)
	cd tests && ../$(BIN)/python -m campaign.fuzz --seconds $(CAMPAIGN_SECONDS) --seed $$(date +%s) --report $(abspath $(OUT))/campaign.json
	STEPWELL_FUZZ=2000000 cargo test --release -p stepwell-core --test kernels --test random_systems -- --nocapture random packed unrolled
	cd tests && ../$(BIN)/python -m campaign.memory --runs 100000
	cd tests && ../$(BIN)/python -m campaign.threads --seconds 60
	cd tests && ../$(BIN)/python -m campaign.processes --times 100

format: .venv/test ## format Rust and Python
	cargo fmt --all
	rustfmt --edition 2024 $(LISTED)
	$(BIN)/ruff check --fix --quiet .
	$(BIN)/ruff format --quiet .
	$(BIN)/python docs/generate.py

pins: $(BIN)/python$(EXE) ## bring the tools of development up to date in .ci/constraints.txt; `make test` then shows what they say
	$(BIN)/python .ci/pins.py

clean: ## remove everything that was built
	rm -rf .venv dist target out docs/gallery

# ---- set-up; the files in .venv are stamps

$(BIN)/python$(EXE):
	@command -v cargo >/dev/null || { echo "stepwell needs a Rust toolchain: https://rustup.rs"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "stepwell needs Python 3.11 or later; set PYTHON="; exit 1; }
	$(PYTHON) -m venv .venv

.venv/maturin: $(BIN)/python$(EXE) $(PINS)
	$(PIP) 'maturin>=1.13,<2'
	@touch $@

.venv/wheel: .venv/maturin $(SOURCES)
	rm -f dist/*.whl
	$(BIN)/maturin build --release --quiet --out dist
	@touch $@

.venv/release: .venv/maturin
	$(PIP) 'twine>=6'
	@touch $@

.venv/uv: .venv/maturin
	$(PIP) 'uv>=0.5'
	@touch $@

.venv/zig: .venv/maturin
	$(PIP) 'ziglang>=0.13'
	@touch $@

.venv/wheels: .venv/zig .ci/build_wheels.py .ci/zig-windows $(SOURCES)
	$(BIN)/python .ci/build_wheels.py $(WHEELS)
	@test -n "$(WHEELS)" || touch $@

# Wine's folder, with a library that it lacks, and an interpreter with the package.
.venv/windows: .venv/bin/python $(SOURCES) $(wildcard tests/windows/*)
	@for tool in wine x86_64-w64-mingw32-gcc rustup; do command -v $$tool > /dev/null || \
	  { echo "there is no $$tool here: Debian's packages are wine, wine64 and gcc-mingw-w64-x86-64-win32; rustup is of https://rustup.rs"; exit 1; }; done
	rustup target add $(WINDOWS)
	$(IN_WINE) wine wineboot --init < /dev/null 2> /dev/null
	x86_64-w64-mingw32-gcc -O2 -shared tests/windows/random.c -ladvapi32 -o .venv/wine/drive_c/windows/system32/bcryptprimitives.dll
	$(IN_WINE) PYO3_CROSS=1 cargo build --release --quiet --target $(WINDOWS) -p stepwell-py --features pyo3/extension-module
	rm -rf .venv/for-windows
	$(BIN)/python tests/windows/interpreter.py .venv/for-windows $(BUILT_FOR_WINDOWS)/$(WINDOWS)/release/_core.dll
	@touch $@

# The wheel with the extras that a target asks for. What it and these need is installed while the wheel is built, if make may do two
# things; the wheel then takes the place of an older one, which has the same version.
.venv/demo .venv/demo.needs: EXTRA = chart
.venv/docs .venv/docs.needs: EXTRA = docs
.venv/test .venv/test.needs: EXTRA = test,docs
.venv/bench .venv/bench.needs: EXTRA = bench,chart
NEEDS = import tomllib; project = tomllib.load(open("pyproject.toml", "rb"))["project"]; extras = project["optional-dependencies"]; \
        print(*project["dependencies"], *(need for extra in "$(EXTRA)".split(",") for need in extras[extra]), sep="\n")

.venv/demo.needs .venv/docs.needs .venv/test.needs .venv/bench.needs: .venv/maturin pyproject.toml $(PINS)
	$(BIN)/python -c '$(NEEDS)' > $@.txt
	$(PIP) -r $@.txt
	@touch $@

.venv/demo .venv/docs .venv/test .venv/bench: .venv/%: .venv/%.needs .venv/wheel
	$(PIP) --force-reinstall --no-deps dist/*.whl
	@touch $@

# The two commands that matter: `make run` and `make test`. Each sets up what is missing first.

# Where `make run` listens, and what it adds to `parfocal serve`:
#   make run BIND=0.0.0.0:8080 ARGS='--tls --camera footage:clip.mp4'
BIND ?= 127.0.0.1:8080
ARGS ?=

# GigE Vision and USB3 Vision come in wherever their libraries are; nothing needs them. The shell asks when it comes to
# the command, because .ci/setup may install the libraries just before.
FEATURES := $$(.ci/features)

.PHONY: run test package container check lint web web-types compiled unit cameras interface python python-interface readme packaged bench screenshots fuzz endurance

run:
	@.ci/setup build
	@cargo build $(CARGO_FLAGS) --release --locked $(FEATURES)
	@exec "$${CARGO_TARGET_DIR:-target}/release/parfocal" serve --bind $(BIND) $(ARGS)

test:
	@.ci/setup test
	@$(MAKE) --no-print-directory check

# What a release consists of, in target/: a Debian package, the Python package (wheel and source archive), an SBOM, checksums.
# The program tells what it is made of: `cargo audit bin target/release/parfocal`.
package:
	@.ci/setup package
	@cargo auditable build --release --locked $(FEATURES)
	@FEATURES="$(FEATURES)" deploy/release

# A container image of that package, as root: deploy/container/README.md.
container: package
	@deploy/container/build

# The checks alone, on a machine that is already set up. Two run at a time where one waits now and then: for a program,
# a browser or a disk.
TWO_AT_A_TIME := --no-print-directory --jobs 2 --output-sync=target
check:
	@$(MAKE) $(TWO_AT_A_TIME) lint web
	@$(MAKE) --no-print-directory --jobs 2 unit cameras
	@$(MAKE) $(TWO_AT_A_TIME) interface python readme packaged

# Tests and program are one build, so all is compiled once. `cargo test` alone makes a development build, which is
# faster after a change. `CARGO_FLAGS` says how a check run builds (.ci/run).
# Without the cameras' libraries only the crate that uses them differs.
lint:
	cargo fmt --check
	cargo clippy $(CARGO_FLAGS) --release --all-targets --locked $(FEATURES) -- --deny warnings
	[ -z "$(FEATURES)" ] || cargo clippy $(CARGO_FLAGS) --release --locked --package parfocal-devices -- --deny warnings
	cargo deny --locked check licenses bans sources

# The pages' code: format, lint, types, unit tests.
web:
	npm --prefix web run --silent check
	npm --prefix web run --silent test

# After a change of the HTTP interface: the types that the pages are checked against.
web-types:
	PARFOCAL_WRITE_DESCRIPTION=1 cargo test --release --quiet --locked $(FEATURES) --test system the_pages_are_checked
	npm --prefix web run --silent api

compiled:
	cargo test $(CARGO_FLAGS) --release --locked --no-run $(FEATURES)

# Two for each processor: most tests wait now and then for a disk, a browser or a lens.
TEST_THREADS := $(shell echo $$((2 * $$(nproc))))

# One failing test does not keep the others from running. The bad day takes a kill for each of its troubles.
unit: compiled
	RUST_TEST_THREADS=$(TEST_THREADS) PARFOCAL_KILLS=8 \
		cargo test $(CARGO_FLAGS) --release --locked --no-fail-fast $(FEATURES) -- $(CAMERAS:%=--skip %)

# These wait for a camera, and for one another, most of their time: all other tests run meanwhile.
CAMERAS := network_camera:: camera_card::
cameras: compiled
	cargo test $(CARGO_FLAGS) --release --locked $(FEATURES) --test system -- $(CAMERAS)

# What HTTP answers, against its own description, as each role.
interface:
	.ci/schemathesis $(FEATURES)

# The Python package: format, lint, types, tests.
python:
	.ci/python

# After a change of the HTTP interface and `make web-types`: the Python package's types and methods.
python-interface:
	python3 python/tools/generate_interface.py

readme:
	.ci/readme

# The Debian package, unpacked.
packaged:
	.ci/package

# Pictures of every page and state, in target/screenshots/.
screenshots:
	PARFOCAL_SCREENSHOTS=1 cargo test --release --locked $(FEATURES) --test system -- browser:: tls::trust_page

# Speed: each figure that docs/speed.md states comes from here.
bench:
	cargo bench $(FEATURES)

# A million mutated inputs for each parser of bytes from outside; fewer, or one parser, on request:
#   make fuzz ONLY=protocol INPUTS=10000
# A million of the slow ones (package, backup) takes hours; they can be taken in turns, here the second 250,000:
#   make fuzz ONLY=backup INPUTS=250000 FIRST=250000
INPUTS ?= 1000000
FIRST ?= 0
ONLY ?=
fuzz:
	PARFOCAL_FUZZ_INPUTS=$(INPUTS) PARFOCAL_FUZZ_FIRST=$(FIRST) $(if $(ONLY),PARFOCAL_FUZZ=$(ONLY)) \
		cargo test --release --locked $(FEATURES) --test fuzz -- --ignored --nocapture

# A long day, and a working week faster than time: docs/operations.md. `make endurance SECONDS=180` is a short day.
SECONDS_OF_DAY := $(if $(SECONDS),$(SECONDS),3600)
endurance:
	PARFOCAL_ENDURANCE_SECONDS=$(SECONDS_OF_DAY) \
		cargo test --release --locked $(FEATURES) --test system endurance:: -- --ignored --nocapture --test-threads 1

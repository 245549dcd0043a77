# Everything works from a fresh clone: each target first sets up what it needs.

CARGO ?= cargo

.PHONY: help demo reproduce test build gate baseline lint fmt clippy doc clean setup

help: ## list the targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/make \1\t\2/p' Makefile | expand -t 16

demo: setup ## run the demo scenario and write its results to out/ (options in ARGS)
	$(CARGO) run --release --locked -- run $(ARGS)

reproduce: setup ## set the paper's numbers beside this program's: out/klimchik2012/reproduction.html
	$(CARGO) run --release --locked -- reproduce $(ARGS)

test: setup ## run all tests
	@tools/install-rerun
	$(CARGO) test --release --locked

build: setup ## build the program: target/release/elastocal
	$(CARGO) build --release --locked

gate: build ## compare results with those stored in scenarios/baselines: the same bits on the same platform
	tools/baseline target/gate
	@for name in results study; do target/release/elastocal compare --exact \
	  scenarios/baselines/klimchik2012_$$name.json target/gate/klimchik2012_$$name.json || exit $$?; done

baseline: build ## store new results in scenarios/baselines, to commit where they were meant to change
	tools/baseline scenarios/baselines

lint: fmt clippy doc ## check formatting, lints and documentation

fmt:
	$(CARGO) fmt --check

clippy: setup
	$(CARGO) clippy --release --locked --all-targets -- -D warnings

doc: setup ## build the documentation, with warnings as errors
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --release --locked --no-deps

clean: ## remove what was built and installed; results in out/ stay
	rm -rf target .mujoco .mujoco.* .rerun .rerun.*

setup: ## install MuJoCo, unless MUJOCO_DYNAMIC_LINK_DIR names one
	@command -v $(CARGO) >/dev/null || { echo "error: cargo was not found." \
	  "Install Rust 1.95 or later (rustup), and open a new shell." >&2; exit 1; }
	@tools/install-mujoco

# Everything works from a fresh clone: each target first sets up what it needs.

CARGO ?= cargo

.PHONY: help demo docs gallery python wheel dist site enclosures proofs evidence replanning simulated mutants reproduce test build gate baseline pins pins-quick pins-write bench instructions instructions-baseline scaling fuzz dependencies lint fmt clippy doc clean setup

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/make \1\t\2/p' Makefile | expand -t 28

demo: setup ## run the demo scenario, take its plan to the laboratory, results in out/ (options of run in ARGS)
	$(CARGO) run --release --locked -- run $(ARGS)
ifeq ($(strip $(ARGS)),)
	$(CARGO) run --release --locked --quiet -- lab --quiet --plan out/kr270/plan.csv
endif

reproduce: setup ## set the paper's numbers beside this program's: out/klimchik2012/reproduction.json
	$(CARGO) run --release --locked -- reproduce $(ARGS)

test: setup ## run all tests
	@tools/install-rerun
	$(CARGO) test --release --locked

build: setup ## build the program: target/release/elastocal
	$(CARGO) build --release --locked

docs: build ## run the commands of README and docs/, and compare what they print with what the pages say
	tools/try-docs

gallery: build ## make the pictures of docs/ anew (names of scenarios, demo or study in ARGS), three minutes; needs xvfb, mesa-vulkan-drivers
	@tools/install-chromium
	@tools/install-rerun
	tools/gallery $(ARGS)

python: build ## install the Python package's wheel into .python/ and test it beside the program
	tools/dist wheel
	tools/try-python

wheel: setup ## build the Python package's wheel: dist/
	tools/dist wheel

dist: build ## make what is handed on, in dist/: wheel, tarball, SBOM, checksums; and try it where no Rust is
	tools/dist
	tools/try-dist

site: ## make the documentation as a site with search: .site/html
	tools/site

# Between instruction sets a realised error, a difference of metres, differs by 1e-14 m: 1.4e-9 of 9.5 um.
gate: build ## compare results with those stored in scenarios/baselines: but for rounding the same on the same platform
	tools/baseline target/gate
	@tools/check-renewals
	@for name in results study; do target/release/elastocal compare --within 1e-8 \
	  scenarios/baselines/klimchik2012_$$name.json target/gate/klimchik2012_$$name.json || exit $$?; done

baseline: build ## print what has changed, and store new results in scenarios/baselines where something has
	tools/baseline target/gate
	@for name in results study; do echo; echo "klimchik2012_$$name:"; target/release/elastocal compare --exact --quiet \
	  scenarios/baselines/klimchik2012_$$name.json target/gate/klimchik2012_$$name.json; case $$? in \
	  0) echo "nothing has changed: it stays"; continue;; 3) ;; *) echo "cannot be compared: it is replaced as a whole";; esac; \
	  cp target/gate/klimchik2012_$$name.json scenarios/baselines/; done
	@echo; git --no-pager diff --stat -- scenarios/baselines
	@echo "Commit it where it was meant to change. tools/check-renewals, which CI runs, wants a message that says what changed and by how much."

# Where NumPy is, which the check of proofs needs.
PINS = PYTHONPATH=$(CURDIR)/.python/site tools/pins

pins: pins-quick simulated ## compare results with tests/golden, and tell patterns and models of 240 simulated files

pins-quick: build ## compare what every scenario, and fits to absolute readings, give with tests/golden (ARGS: part of a group's name)
	$(PINS) check $(ARGS)

pins-write: build ## make tests/golden anew, where results were meant to change (ARGS: part of a group's name)
	$(PINS) write $(ARGS)

bench: build ## time the hot paths beside other programs, a few minutes (options in ARGS, such as --quick)
	benches/peers/run $(ARGS)

enclosures: setup ## hold the proof's boxes against a million experiments, a minute
	ENCLOSURES=8 $(CARGO) test --release --locked --lib boxes_enclose_the_experiments_of_arms

proofs: build ## print what is proved of every shipped scenario, in how many boxes and how long
	tools/proof-table

evidence: build ## print what tests find (where MuJoCo rests, how often intervals hold), and make docs/evidence.md: half an hour
	$(CARGO) test --release --locked --test it -- --nocapture --test-threads 1 rest_where_mujoco_does compensator::
	$(CARGO) test --release --locked --lib -- --nocapture intervals_hold_the_truth
	tools/evidence.py

replanning: setup ## what replanning gives from wrong beliefs: 200 campaigns, some minutes
	REPLANNING=200 $(CARGO) test --release --locked --test it -- --nocapture replanned_from_wrong_beliefs

simulated: setup ## tell false alarms, patterns and models of 240 simulated files: some minutes
	SIMULATED=200 $(CARGO) test --release --locked --test it -- --nocapture simulated::

mutants: setup ## change the code in 35 places, and see whether tests notice each: half an hour (a part of a name in ARGS)
	tools/mutants $(ARGS)

instructions: setup ## count the hot paths' instructions: against the baseline, and how they grow
	@tools/install-valgrind
	benches/instructions.py test
	benches/instructions.py check
	benches/scaling.py --check

instructions-baseline: setup ## make today's counts the baseline of that
	@tools/install-valgrind
	benches/instructions.py baseline

scaling: setup ## cost against measurements, joints, runs and threads, to out/scaling.svg and .json
	@tools/install-valgrind
	benches/scaling.py

fuzz: setup ## broken inputs of every reader, until one fails (or for FUZZ_S seconds)
	@tools/fuzz

dependencies: ## hold licences, sources and duplicates of all dependencies against deny.toml
	@tools/check-dependencies
	@if $(CARGO) deny --version >/dev/null 2>&1; then $(CARGO) deny --offline check licenses sources bans; fi

lint: fmt clippy doc ## check formatting, lints and documentation

fmt:
	$(CARGO) fmt --check

clippy: setup
	$(CARGO) clippy --release --locked --all-targets -- -D warnings

doc: setup ## build the documentation, with warnings as errors
	RUSTDOCFLAGS="-D warnings" $(CARGO) doc --release --locked --no-deps

clean: ## remove what was built and installed; results in out/ stay
	rm -rf target python/target dist .dist-tools .site .python .mujoco .mujoco.* .rerun .rerun.* .peers

setup: ## install MuJoCo, unless MUJOCO_DYNAMIC_LINK_DIR names one
	@command -v $(CARGO) >/dev/null || { echo "error: cargo was not found." \
	  "Install Rust 1.95 or later (rustup), and open a new shell." >&2; exit 1; }
	@tools/install-mujoco

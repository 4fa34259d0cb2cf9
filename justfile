# Short names for the project's commands. `cargo install just`, or `pip install rust-just`.

# What is there.
default:
    @just --list

# Format, lints and documentation, warnings as errors.
check:
    cargo fmt --all --check
    cargo clippy --workspace --all-targets --locked -- -D warnings
    RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked
    cargo check --manifest-path fuzz/Cargo.toml --lib

# All tests.
test:
    cargo test --workspace

# The forty tests that took longest.
slowest *args="":
    RUSTC_BOOTSTRAP=1 cargo test --workspace {{args}} -- -Z unstable-options --report-time | grep '<.*s>$' | sort -t '<' -k 2 -g -r | head -40

# What takes too long for every change: numerical stability in its long form (every awkward case, 100,000 random scenes, the matrix of
# threads, builds and instructions); all random lattices that are refined and all events of a drag; mean shift against brute force; folds
# of 10,000 pushes, mapped by both methods; the same bytes from every build. The normal suite has an eighth of the first two.
# `IVD_STRESS_SCENES`, `IVD_STRESS_PUSHES` and `IVD_STRESS_SEED` choose how many and which; a failure names the one to run again.
stress:
    IVD_STRESS_EVERY=1 IVD_STRESS_RUNS=${IVD_STRESS_RUNS:-20} IVD_STRESS_SCENES=${IVD_STRESS_SCENES:-100000} IVD_STRESS_MATRIX=${IVD_STRESS_MATRIX:-8} IVD_STRESS_SPACES=${IVD_STRESS_SPACES:-20000} cargo test --release -p ivd-tests --test integration stability -- --nocapture --test-threads=1
    IVD_STRESS_EVERY=1 cargo test --release -p ivd-lattice -p ivd-session -p ivd-frames --test integration
    IVD_STRESS_EVERY=1 cargo test --release -p ivd-cli --test integration -- hostile faults hands
    cargo test --release -p ivd-segment -p ivd-boundary -- --ignored --nocapture
    cargo test --release -p ivd-field -p ivd-motion -p ivd-map -- --ignored --nocapture
    IVD_STRESS_EVERY=1 cargo test --release -p ivd-gpu --test integration -- --include-ignored --nocapture
    cargo build
    cargo build --release
    bash tests/determinism.sh target/debug/ivd target/release/ivd

# An hour of gestures through the service that makes frames: memory stays, the log gives the same bytes. `IVD_SOAK_SECONDS`, `IVD_SOAK_GESTURES`, `IVD_SOAK_SEED`.
soak:
    cargo test --release -p ivd-frames --test integration -- --ignored --nocapture soak

# Messages that mean harm, sent to the page's server: what it holds stays, and who drives is not held up.
hostile:
    cargo test --release -p ivd-serve --test integration -- --ignored --nocapture hostile

# The whole pipeline on a scene; on a generated head where none is named.
pipeline scene="fixtures/scenes/bust.toml" *args="":
    cargo run --release -- pipeline {{scene}} --explain {{args}}

# The main job on a generated head, no files needed.
demo:
    cargo run --release -- demo

# Every scene on real volumes, where they are.
scenes:
    for scene in fixtures/scenes/*.toml; do echo "== $scene"; cargo run -q --release -- pipeline "$scene" --explain || echo "exit $?"; done

# What the program writes and reads, held against other people's readers (Python, packages from PyPI).
interop:
    cargo build --release
    cargo build --release -p ivd-bench --example measure
    bash tests/interop/run.sh target/release/ivd

# The page of `ivd serve` in Chromium, driven as hands would.
page *args="":
    cargo build --release
    bash tests/page/run.sh target/release/ivd {{args}}

# A scan in a browser, by hand.
serve *args="":
    cargo run --release -- serve {{args}}

# The same in a window.
view *args="":
    cargo run --release -p ivd-view -- {{args}}

# The window on a screen that nobody sees, until it shows the demo's head; `just window out/window.png` keeps a picture.
window *args="":
    cargo build --release -p ivd-view
    bash tests/window/run.sh target/release/ivd-view {{args}}

# Every output of every recipe opened by other programs' readers; and each figure of the reports of all scenes found in --json (pages under target/reports).
readers:
    cargo build --release
    test -x target/interop-venv/bin/python || python3 -m venv target/interop-venv
    target/interop-venv/bin/pip install -q --disable-pip-version-check -r tests/interop/requirements.txt
    target/interop-venv/bin/python tests/interop/recipes.py target/release/ivd
    target/interop-venv/bin/python tests/interop/reports.py target/release/ivd target/reports fixtures/scenes/*.toml

# Every mode of the renderer on real scans that are deformed, as a page (target/gallery/index.html); needs the scans.
gallery *names="":
    cargo build --release
    python3 tests/gallery.py target/release/ivd target/gallery {{names}}

# Every scene's artefacts and decoded outputs against the table; `just golden --write fixtures/golden.tsv` after a change that is meant.
golden *args="--check fixtures/golden.tsv":
    cargo build --release
    test -x target/interop-venv/bin/python || python3 -m venv target/interop-venv
    target/interop-venv/bin/pip install -q --disable-pip-version-check -r tests/interop/requirements.txt
    target/interop-venv/bin/python tests/golden.py target/release/ivd {{args}}

# What every stage and whole scenes take of memory, and what they do under less: `just cage --size 256`, `just cage --no-limits`. Linux.
cage *args="":
    cargo build --release
    python3 tests/memory/cage.py target/release/ivd {{args}}

# What this machine's graphics card makes, against the processor; `IVD_ADAPTER` names one of several.
test-gpu:
    IVD_EXPECT_ADAPTER="" cargo test --release -p ivd-gpu

# Its times beside the processor's: `just measure-gpu 512 1920 1080`.
measure-gpu *args="512 1920 1080 10":
    cargo run --release -p ivd-gpu --example measure_gpu -- {{args}}

# An archive that tests and measures the graphics card of a bare machine (target/ivd-gpu.tar.gz; `./run-gpu.sh` in it).
pack-gpu:
    cargo build --release
    cargo build --release -p ivd-gpu --example measure_gpu
    cargo test --release -p ivd-gpu --test integration --no-run
    bash tests/gpu/pack.sh target/release/ivd target/release/examples/measure_gpu "$(ls -t target/release/deps/integration-* | grep -v '\.d$' | xargs grep -l suite::faults | head -1)" target/ivd-gpu.tar.gz

# Hostile bytes at every reader and stage, a minute each: `just fuzz`, `just fuzz nifti 600`. Needs cargo-fuzz and a nightly compiler.
fuzz target="all" seconds="60":
    fuzz/run.sh {{target}} {{seconds}}

# Run time against error of every stage, as a page with plots: `just bench --quick`, `just bench render --compare OLD.json`.
bench *args="":
    cargo run --release -- bench {{args}}

# The record that defaults are held to and budgets choose by, made again; the machine should have nothing else to do.
fronts:
    cargo run --release -- bench --size 128 --repeats 7 --record fixtures/fronts
    cargo run --release -- bench segment-kmvs segment-emvs --size 128 --repeats 7 --record fixtures/fronts
    cargo run --release -- bench refine-methods solvers map-methods deformation --size 128 --repeats 7 --record fixtures/fronts
    cargo run --release -- bench segment-msvs segment-hvs --size 96 --repeats 3 --record fixtures/fronts

# Times of single kernels: all, or those whose names begin so: `just kernels springs`.
kernels *names="":
    cargo run --release -p ivd-bench --example measure -- kernels {{names}}

# The documentation, in a browser.
doc:
    cargo doc --workspace --no-deps --open

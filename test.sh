#!/usr/bin/env bash
# Runs every check: format, style, lints, documentation, Rust tests, message build, rclpy tests against the node.
#
#     ./test.sh [arguments for pytest]
#
# One line per stage at the end; the output of each stage is kept in .build/logs.
set -euo pipefail
case ${1:-} in
  -h | --help) sed -n '2,/^set /s/^# \{0,1\}//p' "$0" && exit ;;
esac
cd "$(dirname "${BASH_SOURCE[0]}")"
root=$PWD
logs=$root/.build/logs
mkdir -p "$logs"
summary=$logs/summary
: >"$summary"

command -v cargo >/dev/null || { echo "test: needs cargo, Rust's build tool (https://rustup.rs)" >&2; exit 1; }
for component in fmt clippy; do
  cargo "$component" --version >/dev/null 2>&1 ||
    { echo "test: needs cargo $component (rustup component add ${component/fmt/rustfmt})" >&2; exit 1; }
done

# All traffic stays on the loopback interface; each node that pytest starts has its own domain.
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
unset ROS_STATIC_PEERS ROS_LOCALHOST_ONLY ROS_DOMAIN_ID

# Makes the browser test of the report mandatory; without this variable it is skipped where no browser is found.
export VIRTUAL_AXES_NEEDS_BROWSER=1

# Runs a stage, shows and keeps its output, and records its result. Returns the status of the stage.
stage() {
  local title=$1 log=$logs/${1//[^a-zA-Z]/_}.log began=$SECONDS status counts
  shift
  echo "=== $title"
  set +e
  "$@" 2>&1 </dev/null | tee "$log"
  status=${PIPESTATUS[0]}
  set -e
  if [ "$status" -ne 0 ]; then
    echo "FAILED  $(printf '%4d s' $((SECONDS - began)))  $title: status $status, output in $log" >>"$summary"
    return "$status"
  fi
  counts=$(awk '/^test result:/ { passed += $4; failed += $6; ignored += $8; seen = 1 }
    END { if (seen) printf ": %d passed, %d failed, %d ignored", passed, failed, ignored }' "$log")
  [ -n "$counts" ] || counts=$(sed -nE 's/^=+ ([0-9]+ (passed|failed|skipped|error).*) in .*$/: \1/p' "$log" | tail -n 1)
  echo "ok      $(printf '%4d s' $((SECONDS - began)))  $title$counts" >>"$summary"
}

# Prints the summary and exits with a status.
finish() {
  echo
  cat "$summary"
  echo "all:    $(printf '%4d s' $SECONDS)"
  exit "$1"
}

# Starts a function in a process group of its own, with its output in a log.
background() {
  local name=$1
  set -m
  "$@" >"$logs/$name.log" 2>&1 </dev/null &
  background_pid=$!
  set +m
}

# Waits for the background function and shows its output.
join_background() {
  local name=$1 status=0
  wait "$background_pid" || status=$?
  background_pid=
  cat "$logs/$name.log"
  [ "$status" -eq 0 ] || finish 1
}

background_pid=
trap '[ -z "$background_pid" ] || kill -TERM -- "-$background_pid" 2>/dev/null || true' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP

set_up() {
  stage "set-up and message build" tools/setup.sh --browser
}

# Work for the processor; runs beside the rclpy tests, whose nodes mostly wait for their clocks.
rust_checks() {
  renice -n 15 -p $BASHPID >/dev/null
  stage "cargo clippy" cargo clippy --release --workspace --all-targets --locked -- -D warnings &&
    stage "cargo doc" env RUSTDOCFLAGS="-D warnings" cargo doc --release --workspace --no-deps --locked &&
    stage "cargo test" cargo test --release --workspace --locked --no-fail-fast &&
    stage "short runs of the fuzz targets" tools/fuzz.sh short
}

# Two files at a time, since the tests of a file share nodes; in alphabetical order.
python_tests() (
  # shellcheck source=/dev/null
  source "$root/.build/env.sh"
  python -m pytest test_py -n 2 --dist loadscope --no-loadscope-reorder --max-worker-restart 2 "$@"
)

stage "format" bash -c "cargo fmt --all --check && cargo fmt --check --manifest-path fuzz/Cargo.toml" || finish 1
stage "style" tools/check_style.py || finish 1
background set_up
stage "part programs" tools/part_programs.py || finish 1
stage "dependencies" tools/dependencies.py || finish 1
# As users build: the documentation test finds it compiled. Before the workspace, whose features differ: both put
# their programs in the same place.
stage "cargo build, command alone" cargo build --release --locked --no-default-features --features cli || finish 1
stage "cargo build, package alone" cargo build --release --locked --bins || finish 1
stage "cargo build" cargo build --release --workspace --locked --bins || finish 1
stage "reference" tools/reference.py || finish 1
join_background set_up
stage "ruff" bash -c ".venv/bin/ruff format --check && .venv/bin/ruff check" || finish 1
# Before the rclpy tests, which open the site in a browser.
stage "documentation" tools/build_docs.sh || finish 1
background rust_checks
stage "rclpy tests" python_tests "$@" || finish 1
join_background rust_checks
finish 0

#!/usr/bin/env bash
# Every test: Rust, the message build, rclpy against the real node. A line per stage; some run side by side.
#
#     ./test.sh [arguments for pytest]
set -euo pipefail
case ${1:-} in
  -h | --help) sed -n '2,/^set /s/^# \{0,1\}//p' "$0" && exit ;;
esac
cd "$(dirname "${BASH_SOURCE[0]}")"
root=$PWD
logs=$root/.build/logs
mkdir -p "$logs"

command -v cargo >/dev/null || { echo "test: needs cargo, Rust's build tool (https://rustup.rs)" >&2; exit 1; }
for component in fmt clippy; do
  cargo "$component" --version >/dev/null 2>&1 ||
    { echo "test: needs cargo $component (rustup component add ${component/fmt/rustfmt})" >&2; exit 1; }
done

# Nothing leaves this machine; each node that pytest starts gets a domain of its own.
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
unset ROS_STATIC_PEERS ROS_LOCALHOST_ONLY ROS_DOMAIN_ID

# The report is opened in a browser; without one that test fails here, elsewhere it is skipped.
export VIRTUAL_AXES_NEEDS_BROWSER=1

began=$SECONDS
summary=()

# Runs a stage with its output shown and kept; the first that fails ends the run.
stage() {
  local title=$1 log=$logs/stage-${#summary[@]}.log start=$SECONDS status
  shift
  echo "=== $title"
  set +e
  "$@" 2>&1 | tee "$log"
  status=${PIPESTATUS[0]}
  set -e
  account "$title" "$log" "$status" $((SECONDS - start))
}

# Begins a stage beside the others, with its output kept: `finish_background` shows it.
background() {
  background_title=$1 background_log=$logs/stage-beside-${#summary[@]}.log
  rm -f "$background_log.status"
  shift
  echo "=== $background_title (begins; its output comes when it has ended)"
  # A group of its own, so that all of it can be ended.
  set -m
  (
    began=$SECONDS status=0
    "$@" || status=$?
    echo "$status $((SECONDS - began))" >"$background_log.status"
  ) >"$background_log" 2>&1 </dev/null &
  background_pid=$!
  set +m
}

# Waits for the stage in the background.
finish_background() {
  local status took
  wait "$background_pid" || true
  background_pid=
  echo "=== $background_title"
  cat "$background_log"
  # None where it was killed.
  read -r status took 2>/dev/null <"$background_log.status" || { status=137 took=0; }
  account "$background_title" "$background_log" "$status" "$took"
}

end_background() {
  [ -z "$background_pid" ] || kill -TERM -- "-$background_pid" 2>/dev/null || true
}
background_pid=
trap end_background EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP

# Notes how a stage ended: title, log, status, seconds. The first that fails ends the run.
account() {
  local title=$1 log=$2 status=$3 took=$4
  if [ "$status" -ne 0 ]; then
    summary+=("FAILED  $(printf '%4d s' "$took")  $title: status $status, output in $log")
    finish 1
  fi
  # Test counts, where the stage prints some.
  local counts
  counts=$(awk '/^test result:/ { passed += $4; failed += $6; ignored += $8; seen = 1 }
    END { if (seen) printf ": %d passed, %d failed, %d ignored", passed, failed, ignored }' "$log")
  [ -n "$counts" ] || counts=$(sed -nE 's/^=+ ([0-9]+ (passed|failed|skipped|error).*) in .*$/: \1/p' "$log" | tail -n 1)
  summary+=("ok      $(printf '%4d s' "$took")  $title$counts")
}

finish() {
  echo
  printf '%s\n' "${summary[@]}"
  echo "all:    $(printf '%4d s' $((SECONDS - began)))"
  exit "$1"
}

# Two files at a time, since the tests of a file share nodes; in their order, which ends with short ones.
python_tests() (
  # shellcheck source=/dev/null
  source "$root/.build/env.sh"
  python -m pytest test_py -n 2 --dist loadscope --no-loadscope-reorder "$@"
)

# The set-up waits for the network while cargo works. The nodes in real time wait for their clocks most of
# the time; cargo test has what they leave.
background "set-up and message build" tools/setup.sh --browser
stage "cargo fmt --check" bash -c "cargo fmt --check && cargo fmt --check --manifest-path fuzz/Cargo.toml"
stage "dependencies: licenses, sources, the table of them" tools/dependencies.py
stage "cargo clippy" cargo clippy --release --all-targets --locked -- -D warnings
stage "library without ROS" cargo clippy --release --lib --no-default-features --locked -- -D warnings
stage "cargo doc" env RUSTDOCFLAGS="-D warnings" cargo doc --release --no-deps --locked
stage "cargo build" cargo build --release --locked --bins
finish_background
stage "ruff: formatting and lints of Python" bash -c ".venv/bin/ruff format --check && .venv/bin/ruff check"
background "cargo test" nice -n 15 cargo test --release --locked
stage "rclpy against the node" python_tests "$@"
finish_background
stage "bad input: short runs of the fuzz targets" tools/fuzz.sh short
finish 0

#!/usr/bin/env bash
# Every test: Rust, the message build, rclpy against the real node. A line per stage.
#
#     ./test.sh [arguments for pytest]
set -euo pipefail
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
  if [ "$status" -ne 0 ]; then
    summary+=("FAILED  $(printf '%4d s' $((SECONDS - start)))  $title: status $status, output in $log")
    finish 1
  fi
  # Test counts, where the stage prints some.
  local counts
  counts=$(awk '/^test result:/ { passed += $4; failed += $6; ignored += $8; seen = 1 }
    END { if (seen) printf ": %d passed, %d failed, %d ignored", passed, failed, ignored }' "$log")
  [ -n "$counts" ] || counts=$(sed -nE 's/^=+ ([0-9]+ (passed|failed|skipped|error).*) in .*$/: \1/p' "$log" | tail -n 1)
  summary+=("ok      $(printf '%4d s' $((SECONDS - start)))  $title$counts")
}

finish() {
  echo
  printf '%s\n' "${summary[@]}"
  echo "all:    $(printf '%4d s' $((SECONDS - began)))"
  exit "$1"
}

python_tests() (
  # shellcheck source=/dev/null
  source "$root/.build/env.sh"
  python -m pytest test_py "$@"
)

stage "set-up and message build" tools/setup.sh --browser
stage "cargo fmt --check" cargo fmt --check
stage "cargo clippy" cargo clippy --release --all-targets --locked -- -D warnings
stage "library without ROS" cargo clippy --release --lib --no-default-features --locked -- -D warnings
stage "cargo doc" env RUSTDOCFLAGS="-D warnings" cargo doc --release --no-deps --locked
stage "cargo build" cargo build --release --locked --bins
stage "cargo test" cargo test --release --locked
stage "rclpy against the node" python_tests "$@"
finish 0

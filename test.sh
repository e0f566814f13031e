#!/usr/bin/env bash
# Runs what a change can break: format, style, lints, Rust tests, message build, rclpy tests against the node.
#
#     ./test.sh [--all] [arguments for pytest]
#     ./test.sh --quick
#
# With --all, also fuzzing, sanitizers, two hosts, simultaneous starts, the wheel, the documentation with all its
# commands, and browser checks, as continuous integration does. With --quick, only what needs no Python environment:
# format, style, lints, and the unit tests of virtual_axes_core.
# One line per stage at the end, with its duration and CPU time; the output of each stage is kept in .build/logs.
set -euo pipefail
mode=default
case ${1:-} in
  -h | --help) sed -n '2,/^set /s/^# \{0,1\}//p' "$0" && exit ;;
  --all | --quick) mode=${1#--} && shift ;;
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
[ $mode = all ] && export VIRTUAL_AXES_NEEDS_BROWSER=1

# Runs a stage, shows and keeps its output, and records its result. Returns the status of the stage.
stage() {
  local title=$1 log=$logs/${1//[^a-zA-Z]/_}.log status took counts TIMEFORMAT='%0R s, CPU %U %S'
  shift
  echo "=== $title"
  set +e
  {
    time "$@" 2>&1 </dev/null | tee "$log"
    status=${PIPESTATUS[0]}
  } 2>"$log.time"
  set -e
  took=$(awk '{ printf "%5d s %5d s CPU  ", $1, $4 + $5 }' "$log.time")
  if [ "$status" -ne 0 ]; then
    echo "FAILED $took$title: status $status, output in $log" >>"$summary"
    return "$status"
  fi
  counts=$(awk '/^test result:/ { passed += $4; failed += $6; ignored += $8; seen = 1 }
    END { if (seen) printf ": %d passed, %d failed, %d ignored", passed, failed, ignored }' "$log")
  [ -n "$counts" ] || counts=$(sed -nE 's/^=+ ([0-9]+ (passed|failed|skipped|error).*) in .*$/: \1/p' "$log" | tail -n 1)
  echo "ok     $took$title$counts" >>"$summary"
}

# Prints the summary and exits with a status.
finish() {
  echo
  cat "$summary"
  echo "all:   $(printf '%5d s' $SECONDS)"
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
  local options=
  [ $mode = all ] && options="--browser --linuxcnc"
  stage "set-up and message build" tools/setup.sh $options
}

# Work for the processor; runs beside the rclpy tests, whose nodes mostly wait for their clocks.
rust_checks() {
  renice -n 15 -p $BASHPID >/dev/null
  # The tests with sanitizers are marked as ignored.
  local ignored=
  [ $mode = all ] && ignored=--include-ignored
  stage "cargo test" cargo test --release --workspace --locked --no-fail-fast -- $ignored || return
  [ $mode = all ] || return 0
  stage "cargo doc" env RUSTDOCFLAGS="-D warnings" cargo doc --release --workspace --no-deps --locked &&
    stage "short runs of the fuzz targets" tools/fuzz.sh short
}

lints() {
  stage "cargo clippy" cargo clippy --release --workspace --all-targets --locked -- -D warnings
}

# Two files at a time, since the tests of a file share nodes; in alphabetical order.
python_tests() (
  # shellcheck source=/dev/null
  source "$root/.build/env.sh"
  [ $mode = all ] || set -- -m "not extended" "$@"
  python -m pytest test_py -n 2 --dist loadscope --no-loadscope-reorder --max-worker-restart 2 "$@"
)

# Built as users build it, with features of its own.
wheel() {
  rm -rf .build/wheel
  PATH=$root/.venv/bin:$PATH python -m pip wheel --disable-pip-version-check --no-deps --no-build-isolation -w .build/wheel .
}

stage "format" bash -c "cargo fmt --all --check && cargo fmt --check --manifest-path fuzz/Cargo.toml" || finish 1
stage "style" tools/check_style.py || finish 1
if [ $mode = quick ]; then
  lints || finish 1
  stage "unit tests" cargo test --release --locked -p virtual_axes_core --lib || finish 1
  finish 0
fi
background set_up
stage "part programs" tools/part_programs.py || finish 1
stage "dependencies" tools/dependencies.py || finish 1
if [ $mode = all ]; then
  # As README.md installs it; test_py/test_documentation.py installs it as docs/tutorials/first-run.md does.
  stage "command alone" cargo install --quiet --locked --path . --no-default-features --features cli --profile quick \
    --root .build/command || finish 1
fi
stage "cargo build" cargo build --release --workspace --locked || finish 1
stage "reference" tools/reference.py || finish 1
# Before the rclpy tests, some of which call cargo and would wait for its lock.
lints || finish 1
join_background set_up
stage "ruff" bash -c ".venv/bin/ruff format --check && .venv/bin/ruff check" || finish 1
if [ $mode = all ]; then
  # Before the rclpy tests, which install the wheel and open the site in a browser.
  stage "wheel" wheel || finish 1
  stage "documentation" tools/build_docs.sh --without-outputs || finish 1
fi
background rust_checks
stage "rclpy tests" python_tests "$@" || finish 1
join_background rust_checks
finish 0

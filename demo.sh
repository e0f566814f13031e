#!/usr/bin/env bash
# Runs the ballbar on the virtual axes over ROS 2, prints the deviations, writes .build/ballbar.png, and runs
# the same trial offline with a report page, .build/ballbar.html.
#
#     ./demo.sh [--fast] [--out FILE.png]
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
options=("$@")

# Rejects an invalid file name before the build.
picture() {
  case ${1,,} in
    -* | .png | .pdf | .svg) ;;
    *.png | *.pdf | *.svg) return ;;
  esac
  echo "demo: --out: the file extension of '$1' must be .png, .pdf or .svg" >&2
  exit 2
}

while [ $# -gt 0 ]; do
  case $1 in
    --fast) ;;
    --out=*) picture "${1#--out=}" ;;
    --out) [ $# -gt 1 ] || { echo "demo: --out requires a file" >&2 && exit 2; } && shift && picture "$1" ;;
    -h | --help) sed -n '2,/^set /s/^# \{0,1\}//p' "$0" && exit ;;
    *) echo "demo: unknown option $1; allowed: --fast, --out FILE.png, --help" >&2 && exit 2 ;;
  esac
  shift
done
command -v cargo >/dev/null || { echo "demo: needs cargo, Rust's build tool (https://rustup.rs)" >&2; exit 1; }

# The setup mostly waits for the network and single processes; cargo builds in parallel.
mkdir -p "$root/.build/logs"
"$root/tools/setup.sh" --demo >"$root/.build/logs/demo-setup.log" 2>&1 </dev/null &
setup=$!
trap 'kill -TERM "$setup" 2>/dev/null || true' EXIT
echo "demo: building, and setting up Python beside it (log: .build/logs/demo-setup.log); minutes at the first run" >&2
(cd "$root" && exec cargo build --release --locked --bin virtual_axes --bin virtual_axes_node) &
build=$!
trap 'kill -TERM "$setup" "$build" 2>/dev/null || true' EXIT
# Whichever fails first ends the demo.
for _ in setup build; do
  wait -n || { cat "$root/.build/logs/demo-setup.log" >&2; exit 1; }
done
trap - EXIT
# shellcheck source=/dev/null
source "$root/.build/env.sh"

# All traffic stays on the loopback interface; demo.py uses its own domain.
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
unset ROS_STATIC_PEERS ROS_LOCALHOST_ONLY

# demo.py stops the node on every exit; this shell forwards signals to it.
python "$root/test_py/demo.py" "${options[@]}" &
demo=$!
trap 'kill -TERM "$demo" 2>/dev/null || true; wait "$demo" || true' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP
wait "$demo"
trap - EXIT

page=$root/.build/ballbar.html
echo
echo "The same trial without ROS:"
echo
"${CARGO_TARGET_DIR:-$root/target}/release/virtual_axes" run ballbar --controller cascade,cascade-noff,gpc --report "$page"
echo
echo "page with plots: $page"
python "$root/tools/screenshot.py" "$page" "${page%.html}-page.png"

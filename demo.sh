#!/usr/bin/env bash
# Runs the ballbar on the virtual axes over ROS 2, prints the errors, writes .build/ballbar.png.
#
#     ./demo.sh [--fast] [--out FILE.png]
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
command -v cargo >/dev/null || { echo "demo: needs cargo, Rust's build tool (https://rustup.rs)" >&2; exit 1; }

"$root/tools/setup.sh"
(cd "$root" && cargo build --release --locked --bin virtual_axes_node)
# shellcheck source=/dev/null
source "$root/.build/env.sh"

# Nothing leaves this machine; demo.py takes a domain of its own.
export ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
unset ROS_STATIC_PEERS ROS_LOCALHOST_ONLY

# demo.py stops the node however it ends; this shell only makes sure that it is told to.
python "$root/test_py/demo.py" "$@" &
demo=$!
trap 'kill -TERM "$demo" 2>/dev/null || true; wait "$demo" || true' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM HUP
wait "$demo"

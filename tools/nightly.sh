#!/usr/bin/env bash
# Runs the checks that take too long for ./test.sh: DDS Security, processes that start at the same time, and random tests
# with other cases than those of ./test.sh.
#
#     tools/nightly.sh
#
# DDS Security is built in a target directory of its own, .build/security, and needs OpenSSL 3 with its headers and
# pkg-config. One line per check at the end; the exit status is 1 if one failed.
set -uo pipefail
case ${1:-} in
  -h | --help) sed -n '2,/^set /s/^# \{0,1\}//p' "$0" && exit ;;
esac
cd "$(dirname "${BASH_SOURCE[0]}")/.."
summary=()
failed=0

# Runs a command and records its result.
check() {
  local title=$1 began=$SECONDS result=ok
  shift
  echo "=== $title"
  "$@" </dev/null || { result=FAILED && failed=1; }
  summary+=("$(printf '%-8s%5d s  %s' "$result" $((SECONDS - began)) "$title")")
}

security_tests() {
  # shellcheck source=/dev/null
  source .build/env.sh
  VIRTUAL_AXES_SECURE_NODE=$PWD/.build/security/debug/virtual_axes_node python -m pytest -q test_py/test_security.py
}

simultaneous_starts() {
  # shellcheck source=/dev/null
  source .build/env.sh
  tools/measure.py simultaneous-start --trials 200
}

check "build with DDS Security" cargo build --locked --features security --bin virtual_axes_node --target-dir .build/security
check "tests of DDS Security" security_tests
check "build" cargo build --release --locked --bins
export PROPTEST_RNG_SEED=$RANDOM
check "random tests, PROPTEST_RNG_SEED=$PROPTEST_RNG_SEED" cargo test --release --locked --workspace --no-fail-fast
check "200 simultaneous starts" simultaneous_starts
printf '%s\n' "${summary[@]}"
exit $failed

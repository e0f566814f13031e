#!/usr/bin/env bash
# Creates the Python environment inside the checkout: .venv (rclpy, the message generators, packages of the tests, and
# the module virtual_axes_py as cargo builds it), .build/install (the messages of this package, and the interfaces
# of control_msgs that the node uses)
# and .build/env.sh, which activates both in a shell.
#
#     tools/setup.sh [--demo] [--browser] [--linuxcnc] && source .build/env.sh
#
# With --demo, only what ./demo.sh needs: rclpy, the messages of this package, and packages for figures.
# With --browser, apt-get also installs Chromium and iptables for tests that need them, where that is possible; with
# --linuxcnc, LinuxCNC.
# Another run repeats only stages with changed inputs: each stage ends by writing a stamp with the
# hash of its inputs, so an aborted stage starts again from the beginning.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
root=$PWD
venv=$root/.venv
build=$root/.build
logs=$build/logs
# The interfaces of control_msgs that the tests use; the package is not on PyPI.
overlay=test_py/overlay/control_msgs

fail() {
  echo "setup: $*" >&2
  exit 1
}

browser=false demo=false linuxcnc=false
for argument in "$@"; do
  case $argument in
    --browser) browser=true ;;
    --demo) demo=true ;;
    --linuxcnc) linuxcnc=true ;;
    -h | --help) sed -n '2,/^set /s/^# \{0,1\}//p' "$0" && exit ;;
    *) fail "unknown option $argument; allowed: --demo, --browser, --linuxcnc, --help" ;;
  esac
done

# Runs a step with its output in a log; prints the end of the log if the step fails.
step() {
  local title=$1 log=$logs/$2.log began=$SECONDS
  shift 2
  echo "setup: $title ..." >&2
  # Not `if ! "$@"`: there bash would ignore `set -e` inside the step.
  local status
  set +e
  (set -e && "$@") >"$log" 2>&1 </dev/null
  status=$?
  set -e
  if [ "$status" -ne 0 ]; then
    tail -n 30 "$log" >&2
    fail "$title failed; complete output: $log"
  fi
  echo "setup: $title: $((SECONDS - began)) s" >&2
}

# Installs Debian packages where that is possible without interaction.
try_apt() {
  [ "$(id -u)" = 0 ] && command -v apt-get >/dev/null || return 1
  step "apt-get install $*" apt bash -c 'apt-get update -q && DEBIAN_FRONTEND=noninteractive apt-get install -y -q "$@"' _ "$@"
}

# The wheels are built for Python 3.11 and 3.12; a pyenv shim without an installed version fails.
find_python() {
  local candidate
  for candidate in ${PYTHON:-} python3.12 python3.11 python3; do
    if "$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 13))' 2>/dev/null; then
      # Not the interpreter of a virtual environment, which may be the .venv that is created again.
      "$candidate" -c 'import sys; print(sys._base_executable)'
      return 0
    fi
  done
  return 1
}

missing_header() {
  ! "$1" -c 'import os, sys, sysconfig; sys.exit(not os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")))'
}

check_tools() {
  python=$(find_python) || { try_apt python3 python3-venv python3-dev && python=$(find_python); } ||
    fail "needs Python 3.11 or 3.12 (found: $(python3 --version 2>/dev/null || echo none)); name one with PYTHON=/path/to/python3.12"
  command -v g++ >/dev/null || try_apt g++ || fail "needs g++ (Debian: apt-get install g++)"
  "$python" -c 'import venv, ensurepip' 2>/dev/null || try_apt python3-venv ||
    fail "needs the venv module of $python (Debian: apt-get install python3-venv)"
  ! missing_header "$python" || { try_apt python3-dev && ! missing_header "$python"; } ||
    fail "needs the headers of $python (Debian: apt-get install python3-dev)"
}

# Installs Debian's Chromium; without it, the tests of the report fail or are skipped.
install_browser() {
  command -v chromium chromium-browser google-chrome google-chrome-stable >/dev/null || try_apt chromium ||
    echo "setup: no Chromium (Debian: apt-get install chromium): the test of the report will fail" >&2
}

# Installs what the tests of two hosts need; without it, they are skipped.
install_network_tools() {
  command -v iptables >/dev/null && command -v ip >/dev/null || try_apt iptables iproute2 ||
    echo "setup: no iptables or ip (Debian: apt-get install iptables iproute2): the tests of two hosts are skipped" >&2
}

# Installs LinuxCNC with what its components are compiled with; without it, its tests are skipped.
install_linuxcnc() {
  command -v linuxcnc >/dev/null && [ -e /usr/share/linuxcnc/Makefile.modinc ] ||
    try_apt --no-install-recommends linuxcnc-uspace linuxcnc-uspace-dev ||
    echo "setup: no LinuxCNC (Debian: apt-get install linuxcnc-uspace linuxcnc-uspace-dev): its tests are skipped" >&2
}

# Unpacks libfaketime, which sets the wall clock of the node under test; without it, those tests are skipped.
unpack_faketime() {
  local folder=$build/faketime
  [ ! -e "$folder/usr" ] && command -v apt-get dpkg >/dev/null || return 0
  mkdir -p "$folder"
  (cd "$folder" && apt-get download -q libfaketime && dpkg -x libfaketime_*.deb .) >"$logs/faketime.log" 2>&1 ||
    echo "setup: no libfaketime (apt-get download libfaketime): the tests of the wall clock are skipped" >&2
}

# The CMake files of the wheels contain directories of their build machine.
fix_cmake_paths() {
  local include numpy
  include=$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("include"))')
  numpy=$("$venv/bin/python" -c 'import numpy; print(numpy.get_include())')
  { grep -rlE --include='*.cmake' '/opt/python/cp3[0-9]+' "$venv/share" || true; } | while read -r file; do
    sed -E -i \
      -e "s#/opt/python/cp3[0-9]+-cp3[0-9]+/lib/python3\.[0-9]+/site-packages/numpy/_core/include#$numpy#g" \
      -e "s#/opt/python/cp3[0-9]+-cp3[0-9]+/include/python3\.[0-9]+#$include#g" "$file"
  done
}

# Modules are compiled where they are imported.
install_packages() { # file of requirements
  "$venv/bin/python" -m pip install --disable-pip-version-check --prefer-binary --no-compile -r "$1"
}

make_venv() {
  rm -rf "$venv"
  "$python" -m venv "$venv"
  touch "$venv/COLCON_IGNORE"
  install_packages test_py/requirements-demo.txt
  fix_cmake_paths
  "$venv/bin/python" -c 'import matplotlib, numpy, rclpy'
}

add_packages() {
  install_packages test_py/requirements.txt
  "$venv/bin/python" -c 'import pandas, pytest'
}

# Builds the messages of a package below .build/messages into .build/install.
build_messages() { # folder
  PATH=$venv/bin:$PATH VIRTUAL_ENV=$venv AMENT_PREFIX_PATH=$venv CMAKE_PREFIX_PATH=$venv PYTHONPATH='' \
    COLCON_HOME=$build/colcon "$venv/bin/colcon" --log-base "$logs/colcon" build --merge-install \
    --paths "$build/messages/$1" --build-base "$build/messages/build" --install-base "$build/install" \
    --cmake-args -G Ninja -DPython3_EXECUTABLE="$venv/bin/python" -DBUILD_TESTING=OFF \
    -DVIRTUAL_AXES_BUILD_NODE=OFF -DCMAKE_BUILD_TYPE=Release
}

make_messages() {
  # From a copy: CMake refuses to export include directories (.venv's) below the source directory.
  local source=$build/messages/virtual_axes
  rm -rf "$build/install" "$build/messages"
  mkdir -p "$source"
  cp -r package.xml CMakeLists.txt msg "$source"
  build_messages virtual_axes
  cat >"$build/env.sh" <<END
# Written by tools/setup.sh: source it to use rclpy and the messages of virtual_axes.
export PATH="$venv/bin:\$PATH"
export AMENT_PREFIX_PATH="$build/install:$venv"
export LD_LIBRARY_PATH="$build/install/lib:$venv/lib\${LD_LIBRARY_PATH:+:\$LD_LIBRARY_PATH}"
export PYTHONPATH="$(echo "$build"/install/lib/python3*/site-packages)"
END
  # shellcheck source=/dev/null
  (source "$build/env.sh" && python -c 'from virtual_axes.msg import DriveStates, MotorCurrents, TrajectoryResult')
}

make_overlay() {
  rm -rf "$build/messages/control_msgs"
  cp -r "$overlay" "$build/messages"
  build_messages control_msgs
  # shellcheck source=/dev/null
  (source "$build/env.sh" && python -c 'from control_msgs.action import FollowJointTrajectory')
}

# Links the Python module to cargo's output, which is built with the programs; `pip install .` builds a wheel of it.
make_module() {
  command -v cargo >/dev/null || fail "needs cargo, Rust's build tool (https://rustup.rs)"
  cargo build --release --workspace --locked
  ln -sfn "$(realpath "${CARGO_TARGET_DIR:-target}")/release/lib_native.so" crates/py/python/virtual_axes_py/_native.abi3.so
  echo "$root/crates/py/python" >"$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/virtual_axes_py.pth"
  (cd / && "$venv/bin/python" -c 'import virtual_axes_py; virtual_axes_py.Machine.load()')
}

# The path of the checkout is an input: a virtual environment cannot be moved.
hash_of() {
  { printf '%s\0' "$root" "$@"; cat "$@"; } | sha256sum | cut -d' ' -f1
}

is_done() { # stamp file, hash
  [ -f "$1" ] && [ "$(cat "$1")" = "$2" ]
}

venv_hash=$(hash_of tools/setup.sh test_py/requirements-demo.txt test_py/constraints.txt)
messages_hash=$(hash_of tools/setup.sh test_py/requirements-demo.txt test_py/constraints.txt package.xml CMakeLists.txt msg/*.msg msg/action/*.action)
packages_hash=$(hash_of test_py/requirements*.txt test_py/constraints.txt docs/requirements.txt)
overlay_hash=$(hash_of "$overlay"/package.xml "$overlay"/CMakeLists.txt "$overlay"/*/*.msg "$overlay"/*/*.action)
venv_stamp=$venv/setup.stamp
packages_stamp=$venv/packages.stamp
overlay_stamp=$build/overlay.stamp
messages_stamp=$build/messages.stamp

mkdir -p "$logs"
touch "$build/COLCON_IGNORE"
exec 8>"$build/setup.lock"
if command -v flock >/dev/null; then flock 8; fi

if ! is_done "$venv_stamp" "$venv_hash" || ! "$venv/bin/python" -c '' 2>/dev/null; then
  check_tools
  rm -f "$messages_stamp"
  step "Python packages into .venv" venv make_venv
  echo "$venv_hash" >"$venv_stamp"
fi
if ! is_done "$messages_stamp" "$messages_hash"; then
  check_tools
  rm -f "$messages_stamp" "$overlay_stamp"
  step "messages into .build" messages make_messages
  echo "$messages_hash" >"$messages_stamp"
fi
if $demo; then exit; fi
if ! is_done "$packages_stamp" "$packages_hash"; then
  step "Python packages of the tests into .venv" packages add_packages
  echo "$packages_hash" >"$packages_stamp"
fi
if ! is_done "$overlay_stamp" "$overlay_hash"; then
  step "control_msgs into .build" overlay make_overlay
  echo "$overlay_hash" >"$overlay_stamp"
fi
unpack_faketime
step "virtual_axes_py into .venv" module make_module
if $browser; then install_browser; install_network_tools; fi
if $linuxcnc; then install_linuxcnc; fi

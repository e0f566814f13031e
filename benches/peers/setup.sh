#!/usr/bin/env bash
# Installs the peers of the comparison from PyPI into .build/peers. Another run does nothing unless
# requirements.txt or constraints.txt changed. An unavailable package is reported here and by run.py.
#
#     benches/peers/setup.sh
set -euo pipefail
case ${1:-} in
  "") ;;
  -h | --help) sed -n '2,/^set /s/^# \{0,1\}//p' "$0" && exit ;;
  *) echo "setup: unknown option $1; allowed: --help" >&2 && exit 2 ;;
esac
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
peers=benches/peers
venv=$PWD/.build/peers
stamp=$venv/setup.stamp

wanted=$({ echo "$PWD"; cat "$peers/setup.sh" "$peers/requirements.txt" "$peers/constraints.txt"; } | sha256sum | cut -d' ' -f1)
if [ -f "$stamp" ] && [ "$(cat "$stamp")" = "$wanted" ]; then exit 0; fi

# The wheels are for Python 3.11 and 3.12.
python=
for candidate in ${PYTHON:-} python3.12 python3.11 python3; do
  if "$candidate" -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 13))' 2>/dev/null; then
    python=$candidate
    break
  fi
done
[ -n "$python" ] || { echo "setup: needs Python 3.11 or 3.12; name one with PYTHON=/path/to/python3.12" >&2; exit 1; }

rm -rf "$venv"
"$python" -m venv "$venv"
pip=("$venv/bin/python" -m pip install --disable-pip-version-check --prefer-binary --quiet)
if ! "${pip[@]}" -r "$peers/requirements.txt"; then
  echo "setup: joint installation failed; installing the packages one by one" >&2
  grep -E '^[a-z]' "$peers/requirements.txt" | while read -r package; do
    "${pip[@]}" -c "$peers/constraints.txt" "$package" || echo "setup: not available: $package" >&2
  done
  # The next call tries again.
  exit 0
fi
echo "$wanted" >"$stamp"

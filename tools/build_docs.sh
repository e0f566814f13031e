#!/usr/bin/env bash
# Builds the documentation as a site into .build/docs/html: warnings are errors, the search works without network.
#
#     tools/setup.sh && cargo build --release && tools/build_docs.sh
set -euo pipefail
case ${1:-} in
  -h | --help) sed -n '2,/^set /s/^# \{0,1\}//p' "$0" && exit ;;
esac
cd "$(dirname "${BASH_SOURCE[0]}")/.."
[ -x .venv/bin/sphinx-build ] || { echo "build_docs: needs the Python environment: tools/setup.sh" >&2; exit 1; }
# Figures of the paper beside the results of the program.
.venv/bin/python tools/reproduction.py
.venv/bin/sphinx-build --builder html --fail-on-warning --keep-going --quiet --jobs auto \
  --doctree-dir .build/docs/doctrees docs .build/docs/html
echo "documentation: $PWD/.build/docs/html/index.html"

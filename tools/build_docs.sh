#!/usr/bin/env bash
# Builds the documentation as a site into .build/docs/html: warnings are errors, the search works without network.
# Executes the notebooks if the module virtual_axes_py is there: ten minutes; later only those that changed.
#
#     tools/setup.sh && cargo build --release && tools/build_docs.sh [--without-outputs]
#
# With --without-outputs, it executes no notebook, as Read the Docs.
set -euo pipefail
outputs=true
case ${1:-} in
  -h | --help) sed -n '2,/^set /s/^# \{0,1\}//p' "$0" && exit ;;
  --without-outputs) outputs=false ;;
  "") ;;
  *) echo "build_docs: unknown option $1; allowed: --without-outputs, --help" >&2 && exit 2 ;;
esac
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=.venv/bin/python
"$python" -c "import myst_nb, sphinx, sphinx_copybutton" 2>/dev/null ||
  { echo "build_docs: needs the packages of docs/requirements.txt: tools/setup.sh" >&2; exit 1; }
options=()
if $outputs && "$python" -c "import virtual_axes_py" 2>/dev/null; then
  # Relative to the directory of the doctrees.
  options=(-D nb_execution_mode=cache -D nb_execution_cache_path="$PWD/.build/docs/notebooks")
fi
"$python" -m sphinx --builder html --fail-on-warning --keep-going --quiet --jobs auto "${options[@]}" \
  --doctree-dir .build/docs/doctrees docs .build/docs/html
echo "documentation: $PWD/.build/docs/html/index.html"

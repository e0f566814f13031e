#!/usr/bin/env bash
# Fuzzes all external inputs (fuzz/) on stable Rust, without cargo-fuzz.
#
#     tools/fuzz.sh build            builds the targets
#     tools/fuzz.sh short            runs each target for a fixed number of inputs from its seeds; reproducible
#     tools/fuzz.sh long MINUTES     runs all targets on all cores for MINUTES in total; prints a Markdown table
#
# FUZZ_TARGETS selects targets. The long run adds inputs with new coverage to fuzz/corpus and failing inputs to
# fuzz/artifacts; `tools/fuzz.sh run TARGET FILE` runs one input.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
host=$(rustc -vV | sed -n 's/^host: //p')
binaries=fuzz/target/$host/release
targets=${FUZZ_TARGETS:-$(sed -nE 's/^name = "(.*)"$/\1/p' fuzz/Cargo.toml | grep -v virtual_axes)}
mode=${1:-short}

# Limits of one input: seconds and MiB.
limits=(-timeout=20 -rss_limit_mb=1024)
# Seed and number of inputs of the short run.
seed=20240607
runs=2500

# The flags of cargo-fuzz without a sanitizer: the library forbids unsafe code.
build() {
  command -v g++ >/dev/null || { echo "fuzz: g++ is required to build libFuzzer (Debian: apt-get install g++)" >&2; exit 1; }
  local flag coverage="-Cpasses=sancov-module"
  for flag in level=4 inline-8bit-counters pc-table trace-compares; do
    coverage+=" -Cllvm-args=-sanitizer-coverage-$flag"
  done
  RUSTFLAGS="$coverage --cfg fuzzing" cargo build --manifest-path fuzz/Cargo.toml --release --locked --target "$host" --bins
}

# Writes libFuzzer's dictionary: names of parameters, which the reference lists from the schema, keys of the built-in
# files, words of the seeds, and numbers and marks of YAML that none of them has.
dictionary() {
  mkdir -p .build
  {
    grep -rhoE '`[a-z0-9_.]{2,40}`' docs/reference/parameters | tr -d '`'
    grep -rhoE '[a-z0-9_]{1,40}: ' config
    LC_ALL=C grep -rhIoE '[<"#$~/_:-]{0,3}[A-Za-z_][A-Za-z0-9_]{1,30}[]:=.>([{]{0,2}' fuzz/seeds
    printf '%s\n' -0.0 1e-320 1e308 .inf .nan '!!float' '&a' '*a' --- '<<: ' '**' '{node}'
  } | LC_ALL=C sort -u | sed 's/[\\"]/\\&/g; s/.*/"&"/' >.build/words.dict
}

fuzz_one() { # target, log, options of libFuzzer
  local target=$1 log=$2
  shift 2
  mkdir -p "fuzz/corpus/$target" "fuzz/artifacts/$target"
  "$binaries/$target" "${limits[@]}" -dict=.build/words.dict -artifact_prefix="fuzz/artifacts/$target/" "$@" >"$log" 2>&1
}

# Prints the end of the log of a failed run.
show_failure() { # target, log
  echo "fuzz: $1 failed:" >&2
  grep -vE '^#[0-9]' "$2" | tail -n 40 >&2
}

short_one() {
  local target=$1 status=0 scratch
  # libFuzzer writes new inputs to the first folder: the corpus is not used, so that each run is reproducible.
  scratch=$(mktemp -d)
  mkdir "$scratch/found"
  fuzz_one "$target" "$scratch/log" -seed="$seed" -runs="$runs" -max_len=4096 "$scratch/found" \
    "fuzz/seeds/$target" || status=1
  if [ $status -eq 0 ]; then
    echo "$target: $(sed -nE 's/^Done ([0-9]+) runs in ([0-9]+) second.*/\1 inputs, \2 s/p' "$scratch/log")"
  else
    show_failure "$target" "$scratch/log"
  fi
  rm -rf "$scratch"
  return $status
}

long_one() {
  local target=$1 seconds=$2 log=$3 status=0
  fuzz_one "$target" "$log" -max_total_time="$seconds" -max_len=20000 -print_final_stats=1 \
    "fuzz/corpus/$target" "fuzz/seeds/$target" || status=1
  local inputs all new before after
  inputs=$(sed -nE 's/^stat::number_of_executed_units: +//p' "$log")
  new=$(sed -nE 's/^stat::new_units_added: +//p' "$log")
  before=$(sed -nE 's/^#[0-9]+\s+INITED cov: ([0-9]+) .*/\1/p' "$log")
  after=$(sed -nE 's/^#[0-9]+.* cov: ([0-9]+) ft: ([0-9]+) .*/\1 | \2/p' "$log" | tail -n 1)
  all=$(sed -nE 's/^INFO: Loaded 1 modules +\(([0-9]+) inline.*/\1/p' "$log")
  echo "| $target | ${inputs:-?} | ${before:-?} | ${after:-? | ?} | ${all:-?} | ${new:-?} | $status |" >"$log.row"
  [ $status -eq 0 ] || show_failure "$target" "$log"
}

case $mode in
  build) build ;;
  run)
    shift
    target=$1
    shift
    build
    exec "$binaries/$target" "${limits[@]}" "$@"
    ;;
  short)
    build
    dictionary
    export -f fuzz_one short_one show_failure
    export binaries seed runs
    export LIMITS="${limits[*]}"
    printf '%s\n' $targets | xargs -P "$(nproc)" -I{} bash -euc 'limits=($LIMITS); short_one {}'
    ;;
  long)
    minutes=${2:?MINUTES in total for all targets}
    build
    dictionary
    mkdir -p .build/fuzz
    rm -f .build/fuzz/*.row
    count=$(wc -w <<<"$targets")
    seconds=$((minutes * 60 * $(nproc) / count))
    export -f fuzz_one long_one show_failure
    export binaries
    export LIMITS="${limits[*]}"
    printf '%s\n' $targets | xargs -P "$(nproc)" -I{} bash -euc 'limits=($LIMITS); long_one {} '"$seconds"' .build/fuzz/{}.log'
    echo "| target | inputs | edges from the seeds | edges | features | edges of the program | kept | failed |"
    echo "|---|---|---|---|---|---|---|---|"
    cat .build/fuzz/*.row
    ! grep -q '| 1 |$' .build/fuzz/*.row
    ;;
  *)
    echo "fuzz: unknown mode $mode, allowed: build | short | long MINUTES | run TARGET FILE" >&2
    exit 1
    ;;
esac

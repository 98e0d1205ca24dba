#!/usr/bin/env bash
# Installs what is missing, builds everything, runs all tests and counts them. Further options go to `cargo test`.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
echo "Building and running all tests (about a quarter of an hour on two cores) ..."
log=$(mktemp)
trap 'rm -f "$log"' EXIT
# Targets that are tests: documentation holds none, and examples, which `cargo test` alone builds too, are compiled by the lints.
cargo test --locked --workspace "${@:---tests}" 2>&1 | tee "$log"
passed=$(awk '/^test result: ok/ { sum += $4 } END { print sum + 0 }' "$log")
cases=$(grep -o '^[0-9]* of [0-9]* reference cases pass' "$log" || true)
echo "$passed tests passed${cases:+; $cases}."

#!/usr/bin/env bash
# Installs what is missing, builds everything, runs all tests and counts them. Further options go to `cargo test`.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
echo "Running all tests ..."
log=$(mktemp)
trap 'rm -f "$log"' EXIT
cargo test --release --locked --workspace "$@" 2>&1 | tee "$log"
passed=$(awk '/^test result: ok/ { sum += $4 } END { print sum + 0 }' "$log")
cases=$(grep -o '^[0-9]* of [0-9]* reference cases pass' "$log" || true)
echo "$passed tests passed${cases:+; $cases}."

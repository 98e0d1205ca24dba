#!/usr/bin/env bash
# Installs what is missing, builds everything, and runs all tests. Further options go to `cargo test`.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
echo "Running all tests ..."
cargo test --release --locked --workspace "$@"

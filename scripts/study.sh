#!/usr/bin/env bash
# Installs what is missing, builds gsii, compares all methods on the bundled office and writes tables, plots and a page to docs/study.
# Further options go to `gsii study`, for instance: scripts/study.sh --width 320 --curves other.glb
# What is finished is kept in docs/study/work: run it again to go on, with --fresh to start anew.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
echo "Building ..."
cargo build --release --locked --quiet --workspace
mkdir -p out/scaling
scaling=()
for detail in 3000 30000 300000 3000000; do
    scene=out/scaling/office-$detail.glb
    [[ -s $scene ]] || target/release/office --detail "$detail" --reflectance high -o "$scene"
    scaling+=("$scene")
done
exec target/release/gsii study scenes/office-low.glb scenes/office-high.glb --scaling "${scaling[@]}" -o docs/study "$@"

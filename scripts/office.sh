#!/usr/bin/env bash
# Installs what is missing, builds gsii, and renders the bundled office to out/office.exr and out/office.png.
# Further options go to `gsii render`, for instance: scripts/office.sh --width 1920 --error 0.02
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
echo "Building gsii (minutes, the first time) ..."
cargo build --release --locked --bin gsii
mkdir -p out
echo "Rendering scenes/office-high.glb to out/office.exr and out/office.png ..."
cargo run --release --locked --quiet -- render scenes/office-high.glb -o out/office.exr -o out/office.png "$@"

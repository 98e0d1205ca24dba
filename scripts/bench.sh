#!/usr/bin/env bash
# Measures speed and keeps what came out under benches/runs/DATE: machine and commit, rays per second against a bare replay of the same rays, and
# the statistics of renderings with default options, of the bundled office or of the scenes given as arguments. Nothing else should run meanwhile.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
cargo build --release --locked --quiet --bin gsii
folder=benches/runs/$(date +%F)
mkdir -p "$folder" out/bench
{
    echo "commit $(git rev-parse HEAD)$(git diff --quiet HEAD || echo ', with changes')"
    lscpu | grep -E '^(Model name|CPU\(s\)|Thread)'
    grep MemTotal /proc/meminfo
    target/release/gsii --version
    rustc --version
} | tee "$folder/machine.txt"
for bench in passes rays; do
    cargo bench --locked --quiet --bench "$bench" | tee "$folder/$bench.txt"
done
(($#)) || set -- scenes/office-high.glb
for scene in "$@"; do
    name=$(basename "${scene%.*}")
    echo "$scene"
    target/release/gsii render "$scene" -o "out/bench/$name.exr" -o "out/bench/$name.png" --width 320 --height 180 \
        --stats "$folder/$name.json"
    # Where the scene lay here means nothing elsewhere.
    sed -i "s|\(\"scene\": \"\).*/|\1|" "$folder/$name.json"
done

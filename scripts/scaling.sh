#!/usr/bin/env bash
# Makes offices of ten thousand to ten million triangles in out/scaling and measures how preparation, LORES and memory grow with them;
# other numbers of triangles as arguments. The table goes to out/scaling/scaling.md.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
cargo build --release --locked --quiet --package office
cargo build --release --locked --quiet --example scaling
mkdir -p out/scaling
table=out/scaling/scaling.md
{
    echo "| triangles | of N+S | patches | load | simplify | build | radiosity | HIRES | LORES | bytes a triangle | Embree's |"
    echo "|---|---|---|---|---|---|---|---|---|---|---|"
} | tee "$table"
(($#)) || set -- 10000 30000 100000 300000 1000000 3000000 10000000
for detail in "$@"; do
    scene=out/scaling/office-$detail.glb
    [[ -s $scene ]] || target/release/office --detail "$detail" --reflectance high -o "$scene" > /dev/null
    target/release/examples/scaling "$scene" | tee -a "$table"
done

#!/usr/bin/env bash
# Makes offices of ten thousand to ten million triangles in out/scaling and measures how preparation, LORES and memory grow with them, twice:
# with the same things, ever more finely cut, and with more and more things. Other numbers of triangles as arguments. The tables go to
# out/scaling/scaling.md.
set -euo pipefail
cd "$(dirname "$0")/.."
scripts/setup.sh
cargo build --release --locked --quiet --package office
cargo build --release --locked --quiet --example scaling
target=${CARGO_TARGET_DIR:-target}/release
mkdir -p out/scaling
(($#)) || set -- 10000 30000 100000 300000 1000000 3000000 10000000
series() { # name, what, options of the generator
    local name=$1 what=$2
    shift 2
    echo "$what:"
    echo
    echo "| triangles | of N+S | patches | load | simplify | build | radiosity | HIRES | LORES | bytes a triangle | Embree's |"
    echo "|---|---|---|---|---|---|---|---|---|---|---|"
    for detail in "${sizes[@]}"; do
        scene=out/scaling/$name-$detail.glb
        [[ -s $scene ]] || "$target/office" --detail "$detail" --reflectance high "$@" -o "$scene" > /dev/null
        "$target/examples/scaling" "$scene"
    done
    echo
}
sizes=("$@")
{
    series same "The same things, more finely cut" --clutter 0.3
    series more "More things, more finely cut"
} | tee out/scaling/scaling.md

#!/bin/sh
# Spreads the frames of an animation, or one picture, over a Slurm cluster. All nodes must see the same folders.
#
#   scripts/slurm.sh frames 0-23 SCENE out/frame-####.exr [OPTIONS OF gsii render]
#   scripts/slurm.sh tiles 16    SCENE out/picture.png    [OPTIONS OF gsii render]
#
# Frames: one task each, as in --frames. Tiles: so many tasks, then one that merges them. What is there already is not rendered
# again: after a failure submit the same once more. Prints the number of the last job.
#
# GSII   the program [gsii]           CPUS     cores of a task [4]
# CACHE  folder for --cache [cache]   SBATCH   more options of sbatch, as in "--partition=long --mem=8G"
set -eu

program=${GSII:-gsii}
cache=${CACHE:-cache}
cpus=${CPUS:-4}

usage() {
    sed -n '2,11s/^# \{0,1\}//p' "$0" >&2
    exit 2
}

# Runs this script again as a job: options of sbatch, a lone --, then what comes back as arguments.
submit() {
    # shellcheck disable=SC2086 # SBATCH holds several options
    GSII=$program CACHE=$cache sbatch --parsable --export=ALL ${SBATCH:-} "$@"
}

render() {
    "$program" render "$@" --cache "$cache" --threads "${SLURM_CPUS_PER_TASK:-1}" --quiet
}

[ $# -ge 4 ] || usage
what=$1 count=$2 scene=$3 output=$4
shift 4
tile="$output.tile"

case $what in
frames)
    submit --job-name=frames --cpus-per-task="$cpus" --array="$count" "$0" frame "$count" "$scene" "$output" "$@"
    ;;
tiles)
    job=$(submit --job-name=tiles --cpus-per-task="$cpus" --array="1-$count" "$0" tile "$count" "$scene" "$output" "$@")
    submit --job-name=merge --dependency="afterok:$job" "$0" merge "$count" "$scene" "$output"
    ;;

# What follows runs on the nodes.
frame)
    render "$scene" --frames "$SLURM_ARRAY_TASK_ID" -o "$output" "$@"
    ;;
tile)
    part="$tile-$SLURM_ARRAY_TASK_ID.exr"
    [ -e "$part" ] || render "$scene" --tile "$SLURM_ARRAY_TASK_ID/$count" -o "$part" "$@"
    ;;
merge)
    set --
    for i in $(seq "$count"); do
        set -- "$@" "$tile-$i.exr"
    done
    "$program" merge "$@" -o "$output"
    rm "$@"
    ;;
*)
    usage
    ;;
esac

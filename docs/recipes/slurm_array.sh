#!/bin/sh
#SBATCH --job-name=radarsim
#SBATCH --array=1-8
#SBATCH --cpus-per-task=4
#SBATCH --time=01:00:00
#SBATCH --signal=B:TERM@30
#SBATCH --requeue
# A Slurm array: each task computes a share into one store on the shared file system, which several may write at once.
#   sbatch --export=ALL,CONFIG=rls2,N=1e10,OUT=$SCRATCH/results docs/recipes/slurm_array.sh
# and when it is done, on any node:   radarsim run rls2 -n 1e10 --out $SCRATCH/results
# Half a minute before its time is over a task is sent SIGTERM: it stops within two seconds, is queued anew, and goes on
# where it was.
set -u
CONFIG=${CONFIG:-rls2} N=${N:-1e9} OUT=${OUT:-results}

radarsim run "$CONFIG" -n "$N" --out "$OUT" --quiet \
    --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT" --threads "${SLURM_CPUS_PER_TASK:-1}" &
running=$!
trap 'kill -TERM $running' TERM
wait "$running"
status=$?
[ "$status" -gt 128 ] && { wait "$running"; status=$?; }   # the first wait ended with the trap
[ "$status" -eq 143 ] && scontrol requeue "${SLURM_ARRAY_JOB_ID}_$SLURM_ARRAY_TASK_ID"
exit "$status"

#!/usr/bin/env bash
# A Slurm array with a shard for each task: sbatch --export=STORE=file:///srv/bags slurm.sh
# A task that fails can be submitted again alone, with `sbatch --array=7`: what has a verdict is not replayed twice.
#SBATCH --job-name=kerf-fleet
#SBATCH --array=0-63
#SBATCH --cpus-per-task=1
#SBATCH --mem=2G
#SBATCH --time=04:00:00
#SBATCH --requeue
set -euo pipefail
# As many shards as --array has tasks, above. Slurm's own count is 1 when one task is submitted again.
shards=64
# On a disk that all nodes see, so that a task that is requeued to another node finds its journal.
exec kerf-fleet replay --store "$STORE" --shard "$SLURM_ARRAY_TASK_ID/$shards" \
  --journal "${JOURNAL:-$HOME/kerf-fleet-journal}"

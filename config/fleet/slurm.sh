#!/usr/bin/env bash
# A Slurm array with a shard for each task: sbatch --export=STORE=file:///srv/bags slurm.sh
# A task that fails can be submitted again alone: what has a verdict is not replayed twice.
#SBATCH --job-name=kerf-fleet
#SBATCH --array=0-63
#SBATCH --cpus-per-task=1
#SBATCH --mem=2G
#SBATCH --time=04:00:00
#SBATCH --requeue
set -euo pipefail
# On a disk that all nodes see, so that a task that is requeued to another node finds its journal.
exec kerf-fleet replay --store "$STORE" --shard "$SLURM_ARRAY_TASK_ID/$SLURM_ARRAY_TASK_COUNT" \
  --journal "${JOURNAL:-$HOME/kerf-fleet-journal}"

#!/bin/bash
# worker.sh - one worker of the farm as a job of whatever hands out machines. It takes work until its time is nearly
# over or the scheduler wants the machine back, finishes or hands back what it runs (uncounted), and leaves.
#   PBRS_ENV_FILE   what slurm/worker.env.example shows: Redis, store, PBRS_BIN; mode 600, on the shared file system
#   PBRS_WALL_S     seconds this job has; empty = until it is told to leave
#   PBRS_NOTICE_S   seconds between the scheduler's warning and its kill (default 120)
#   PBRS_POOL       queues it takes, by what the machine is good for: cpu, gpu, or names as PBRS_FARM_QUEUES has them
#
# SLURM       sbatch --array=0-99 --requeue --signal=B:TERM@120 --time=4:00:00 -c4 --mem=8G deploy/pilot/worker.sh
# GridEngine  qsub -cwd -t 1-100 -notify -r y -pe smp 4 -l h_rt=4:00:00 -v PBRS_NOTICE_S=60 deploy/pilot/worker.sh
#             (-notify sends USR2 before KILL, by the queue's `notify` seconds)
# HTCondor    executable = deploy/pilot/worker.sh    job_max_vacate_time = 120    kill_sig = SIGTERM
#             request_cpus = 4    request_memory = 8GB    max_retries = 100    queue 100
# PBS         qsub -J 0-99 -r y -l select=1:ncpus=4:mem=8gb -l walltime=4:00:00 deploy/pilot/worker.sh   (kill_delay >= 120)
# LSF         bsub -J "pbrs[1-100]" -r -n 4 -R "span[hosts=1]" -W 4:00 -wa TERM -wt 2 deploy/pilot/worker.sh
# AWS Batch   command ["deploy/pilot/worker.sh"], retryStrategy attempts 10 on "Host EC2*"; spot's notice is looked for below
# elsewhere   PBRS_WALL_S=14400 deploy/pilot/worker.sh        on any machine that sends TERM before it takes itself away
set -uo pipefail

env_file=${PBRS_ENV_FILE:-$HOME/.config/pbrs_farm/worker.env}
if [ ! -r "$env_file" ]; then
  echo "worker.sh: no $env_file: copy deploy/slurm/worker.env.example there" >&2
  exit 2
fi
set -a
# shellcheck source=/dev/null
. "$env_file"
set +a
# A name that stays its own: scheduler, job, element of the array, how often it began anew.
if [ -n "${SLURM_JOB_ID:-}" ]; then
  name=slurm-${SLURM_ARRAY_JOB_ID:-$SLURM_JOB_ID}_${SLURM_ARRAY_TASK_ID:-0}-${SLURM_RESTART_COUNT:-0} cores=${SLURM_CPUS_PER_TASK:-}
elif [ -n "${SGE_TASK_ID:-}" ]; then
  [ "$SGE_TASK_ID" = undefined ] && SGE_TASK_ID=0
  name=sge-${JOB_ID}_${SGE_TASK_ID}-${RESTARTED:-0} cores=${NSLOTS:-}
elif [ -n "${_CONDOR_SLOT:-}" ]; then
  name=condor-$(hostname -s)-${_CONDOR_SLOT}-$$ cores=${OMP_NUM_THREADS:-}
elif [ -n "${PBS_JOBID:-}" ]; then
  name=pbs-${PBS_JOBID%%.*} cores=${NCPUS:-}
elif [ -n "${LSB_JOBID:-}" ]; then
  name=lsf-${LSB_JOBID}_${LSB_JOBINDEX:-0} cores=${LSB_DJOB_NUMPROC:-}
elif [ -n "${AWS_BATCH_JOB_ID:-}" ]; then
  name=batch-${AWS_BATCH_JOB_ID:0:8}-${AWS_BATCH_JOB_ARRAY_INDEX:-0}-${AWS_BATCH_JOB_ATTEMPT:-1} cores=
else
  name=pilot-$(hostname -s)-$$ cores=
fi
export PBRS_FARM_WORKER=${PBRS_FARM_WORKER:-${name//[^A-Za-z0-9_.-]/-}}
scratch=$(mktemp -d "${SLURM_TMPDIR:-${_CONDOR_SCRATCH_DIR:-${TMPDIR:-/tmp}}}/pbrs-XXXXXX") || exit 1
export PBRS_FARM_SCRATCH=$scratch
trap 'rm -rf "$scratch"' EXIT
export PBRS_FARM_GRACE_S=${PBRS_FARM_GRACE_S:-$((${PBRS_NOTICE_S:-120} - 10))}
case ${PBRS_POOL:-} in
  '') ;;
  cpu) export PBRS_FARM_QUEUES=geometry,gl,light,reduce ;;
  gpu) export PBRS_FARM_QUEUES=light.gpu ;;
  *) export PBRS_FARM_QUEUES=$PBRS_POOL ;;
esac
# One slot for every four cores that the scheduler gave.
[ -n "$cores" ] && export PBRS_FARM_SLOTS=${PBRS_FARM_SLOTS:-$((cores > 4 ? cores / 4 : 1))}
echo "worker $PBRS_FARM_WORKER: ${PBRS_FARM_SLOTS:-1} slots, ${PBRS_FARM_GRACE_S} s to leave, scratch $scratch"

words=()
[ -n "${PBRS_WALL_S:-}" ] && words=(--until "$PBRS_WALL_S")
# Whatever the scheduler sends means: leave. It may come before there is a worker to tell.
worker='' told=''
leave() { told=1; [ -z "$worker" ] || kill -TERM "$worker" 2>/dev/null; }
trap leave TERM USR1 USR2 INT XCPU
# GridEngine warns the whole process group: what is ignored here stays so in all that the worker starts.
(trap '' USR1 USR2 XCPU; exec "${PBRS_BIN:-pbrs-farm}" worker "${words[@]}") &
worker=$!
[ -z "$told" ] || leave
# A spot instance is told by its metadata two minutes before.
if [ -n "${AWS_BATCH_JOB_ID:-}${PBRS_SPOT:-}" ]; then
  at=${PBRS_SPOT_URL:-http://169.254.169.254/latest/meta-data/spot/instance-action}
  (while kill -0 "$worker" 2>/dev/null; do curl -fs -m 2 "$at" >/dev/null && kill -TERM "$worker"; sleep 5; done) &
fi
# A signal ends `wait` (its code is above 128), not the worker; what that ended with is asked for once more (127: it was told).
code=0
while kill -0 "$worker" 2>/dev/null; do wait "$worker"; code=$?; done
wait "$worker" 2>/dev/null
again=$?
[ "$again" -eq 127 ] || code=$again
# Told to leave before its time, the job goes back into the queue: exit 99 asks GridEngine, 85 is AWS Batch's and Condor's to retry.
# A worker that was told while it started had no time to leave a note: it died of the signal (143).
if [ -e "$scratch/preempted" ] || [ "$told $code" = "1 143" ]; then
  echo "worker $PBRS_FARM_WORKER: told to leave; back into the queue"
  [ -n "${SLURM_JOB_ID:-}" ] && scontrol requeue "$SLURM_JOB_ID" && exit 0
  [ -n "${SGE_TASK_ID:-}" ] && exit 99
  [ -n "${AWS_BATCH_JOB_ID:-}${_CONDOR_SLOT:-}" ] && exit 85
fi
exit "$code"

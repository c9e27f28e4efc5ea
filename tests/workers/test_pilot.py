"""deploy/pilot/worker.sh: a unique name, an orderly end on every scheduler's signal, and requeueing."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.workers.small_farm import REPO

SCRIPT = REPO / "deploy/pilot/worker.sh"
# Stands in for `pbrs-farm worker`: prints how it was started, and leaves a note at a signal to
# leave. In Python, like the worker: a shell that runs one `sleep` after another sometimes loses a
# signal.
WORKER = f"""#!{sys.executable} -IS
import os, signal, sys, time


def leave(*_):
    open(os.environ["PBRS_FARM_SCRATCH"] + "/preempted", "w").close()
    os.write(1, b"left\\n")
    os._exit(0)


signal.signal(signal.SIGTERM, leave)
names = ("WORKER", "SLOTS", "GRACE_S", "QUEUES")
print(*(os.environ.get("PBRS_FARM_" + name, "") for name in names), *sys.argv[1:], flush=True)
time.sleep(0 if os.environ.get("PBRS_TEST_OVER") else 10)
"""


def started(folder: Path, **env: str) -> subprocess.Popen[str]:
    (folder / "bin").write_text(WORKER)
    (folder / "bin").chmod(0o755)
    (folder / "env").write_text("PBRS_FARM_REDIS=r\n")
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("PBRS_", "SLURM_"))}
    environment = {
        "PBRS_ENV_FILE": str(folder / "env"),
        "PBRS_BIN": str(folder / "bin"),
        "TMPDIR": str(folder),
    }
    return subprocess.Popen(
        ["bash", str(SCRIPT)], env=clean | environment | env, stdout=subprocess.PIPE, text=True,
        preexec_fn=_heed_signals, start_new_session=True,
    )  # fmt: skip


def _heed_signals() -> None:
    # A shell cannot trap a signal that this process ignores since an earlier test.
    for number in (signal.SIGTERM, signal.SIGUSR2):
        signal.signal(number, signal.SIG_DFL)


@pytest.mark.parametrize(
    ("env", "name", "slots"),
    [
        ({"SLURM_JOB_ID": "7", "SLURM_ARRAY_JOB_ID": "5", "SLURM_ARRAY_TASK_ID": "2",
          "SLURM_CPUS_PER_TASK": "8"}, "slurm-5_2-0", "2"),
        ({"SGE_TASK_ID": "undefined", "JOB_ID": "9", "NSLOTS": "4", "RESTARTED": "1"}, "sge-9_0-1", "1"),
        ({"PBS_JOBID": "31[4].host", "NCPUS": "2"}, "pbs-31-4-", "1"),
        ({"LSB_JOBID": "3", "LSB_JOBINDEX": "8"}, "lsf-3_8", ""),
    ],
)  # fmt: skip
def test_a_worker_is_named_and_sized_by_its_scheduler(
    tmp_path: Path, env: dict[str, str], name: str, slots: str
) -> None:
    pool = {"PBRS_POOL": "gpu", "PBRS_WALL_S": "600", "PBRS_TEST_OVER": "1"}
    out, _ = started(tmp_path, **env, **pool).communicate(timeout=20)
    line = out.splitlines()[1]
    assert line == f"{name} {slots} 110 light.gpu worker --until 600"


@pytest.mark.parametrize(
    ("env", "number", "code"),
    [
        ({"SGE_TASK_ID": "1", "JOB_ID": "9"}, signal.SIGUSR2, 99),
        ({"_CONDOR_SLOT": "slot1_2"}, signal.SIGTERM, 85),
        ({"PBS_JOBID": "31.host"}, signal.SIGTERM, 0),
    ],
)
def test_every_scheduler_signal_makes_it_leave_and_requeue(
    tmp_path: Path, env: dict[str, str], number: signal.Signals, code: int
) -> None:
    process = started(tmp_path, **env)
    assert process.stdout is not None
    process.stdout.readline()
    process.stdout.readline()  # the worker runs
    # GridEngine warns all processes, others only the script.
    if number == signal.SIGUSR2:
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    out, _ = process.communicate(timeout=20)
    assert "left" in out
    assert process.returncode == code
    assert not list(tmp_path.glob("pbrs-*"))


def test_a_missing_settings_file_is_reported(tmp_path: Path) -> None:
    done = subprocess.run(
        ["bash", str(SCRIPT)], env={"PBRS_ENV_FILE": str(tmp_path / "none"), "PATH": os.environ["PATH"]},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "worker.env.example" in done.stderr

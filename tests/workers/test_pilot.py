"""deploy/pilot/worker.sh: a name of its own, a way out by every scheduler's signal, back into the queue."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from tests.workers.small_farm import REPO

SCRIPT = REPO / "deploy/pilot/worker.sh"
# Stands for `pbrs-farm worker`: says how it was started, and leaves a note when it is told to leave. Python as the
# worker is: a shell that waits for one `sleep` after another loses a signal now and then.
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
    own = {
        "PBRS_ENV_FILE": str(folder / "env"),
        "PBRS_BIN": str(folder / "bin"),
        "TMPDIR": str(folder),
    }
    return subprocess.Popen(
        ["bash", str(SCRIPT)], env=clean | own | env, stdout=subprocess.PIPE, text=True,
        preexec_fn=_heed_signals, start_new_session=True,
    )  # fmt: skip


def _heed_signals() -> None:
    # A signal that a test before made this process ignore cannot be trapped by a shell it starts.
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
    said = out.splitlines()[1]
    assert said == f"{name} {slots} 110 light.gpu worker --until 600"


@pytest.mark.parametrize(
    ("env", "number", "code"),
    [
        ({"SGE_TASK_ID": "1", "JOB_ID": "9"}, signal.SIGUSR2, 99),
        ({"_CONDOR_SLOT": "slot1_2"}, signal.SIGTERM, 85),
        ({"PBS_JOBID": "31.host"}, signal.SIGTERM, 0),
    ],
)
def test_whatever_a_scheduler_sends_makes_it_leave_and_asks_for_another_turn(
    tmp_path: Path, env: dict[str, str], number: signal.Signals, code: int
) -> None:
    process = started(tmp_path, **env)
    assert process.stdout is not None
    process.stdout.readline()
    process.stdout.readline()  # the worker runs
    # GridEngine warns all that runs, others the script alone.
    if number == signal.SIGUSR2:
        os.killpg(process.pid, number)
    else:
        process.send_signal(number)
    out, _ = process.communicate(timeout=20)
    assert "left" in out
    assert process.returncode == code
    assert not list(tmp_path.glob("pbrs-*"))


def test_without_its_file_of_settings_it_says_so(tmp_path: Path) -> None:
    done = subprocess.run(
        ["bash", str(SCRIPT)], env={"PBRS_ENV_FILE": str(tmp_path / "none"), "PATH": os.environ["PATH"]},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "worker.env.example" in done.stderr

"""The command that does a task of a farm once more, for messages; pure."""

from __future__ import annotations


def rerun_command(job: str, task: str) -> str:
    """`pbrs-farm rerun ...` of the task, as a shell takes it: neither id holds a special character."""
    return f"pbrs-farm rerun {task} --job {job}"

"""The farm's answers as text for people; pure."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, Final

from workers.ledger.task_ledger import WITH_FAILURES

# Counts of a status by class of fault -> what they count.
_COUNTS: Final = {
    "failures": "permanently failed tasks",
    "failed_attempts": "attempts failed",
    "handed_back": "interrupted",
}


def status_text(status: Mapping[str, Any]) -> str:
    """A few lines: the job, a row per stage, problems if any; status: from `Farm.status`."""
    houses = status["houses"]
    lines = [
        f"job {status['job']}  {status['state']}"
        + (f": {status['reason']}" if status["reason"] else "")
        + f"  priority {status['priority']}{', urgent' if status.get('is_urgent') else ''}"
        + (f"  of {status['user']}" if status.get("user") else ""),
        f"houses {houses['done']} done, {houses['open']} open, {houses['waiting']} waiting, "
        f"{houses['quarantined']} quarantined, of {houses['total']};  "
        f"{status['views_done']} views done;  {status['workers']} workers",
        "",
        f"{'stage':<10}{'done':>9}{'running':>9}{'queued':>8}{'failed':>8}{'of':>9}"
        f"{'per h':>9}{'p50':>8}{'p90':>8}{'left':>9}",
    ]
    # A row a stage: tasks by state, rate, durations, time left.
    for stage in status["stages"]:
        lines.append(
            f"{stage['stage']:<10}{stage['done']:>9}{stage['running']:>9}{stage['queued']:>8}"
            f"{stage['failed']:>8}{stage['total']:>9}{3600 * stage['per_s']:>9.0f}"
            f"{duration_text(stage['p50_s'] or None):>8}{duration_text(stage['p90_s'] or None):>8}"
            f"{duration_text(stage['eta_s']):>9}"
        )
    for name, text in _COUNTS.items():
        if status[name]:
            counts = ", ".join(f"{n} {k}" for k, n in sorted(status[name].items()))
            lines.append(f"{text}: {counts}")
    if status["state"] == WITH_FAILURES:
        lines.append(f"`pbrs-farm failures {status['job']}` lists them")
    if status.get("held_back"):
        lines.append(f"blocked: {status['held_back']}")
    if status.get("waits_for"):
        lines.append(f"starts when {', '.join(status['waits_for'])} is done")
    lines += [f"refuses: {r['worker']}: {r['why']}" for r in status["refusing"]]
    if status["storage"] != "ok":
        lines.append(f"storage: {status['storage']}")
    return "\n".join(lines)


def explanation_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """One line per task of `Farm.explain`, with its known details below."""
    lines = []
    for row in rows:
        lines.append(f"{row['task']}: {row['state']}")
        if "for_s" in row:
            lines[-1] += f" for {duration_text(row['for_s'])}"
        for name in ("views", "worker", "attempts", "tried"):
            if name in row:
                value = row[name]
                lines.append(f"    {name}: {' '.join(value) if name == 'views' else value}")
        # A silent holder keeps its task until the lease ends.
        if "silent_s" in row:
            age = row["silent_s"]
            silent = "left the farm" if age is None else f"has been silent for {duration_text(age)}"
            lines.append(f"    the worker {silent}")
        if "lease_s" in row:
            then = ", then another worker gets the task" if "silent_s" in row else ""
            lines.append(f"    its lease ends in {duration_text(row['lease_s'])}{then}")
        if "because" in row:
            lines.append(f"    {row['because']}")
        if "fault" in row:
            fault = row["fault"]
            lines.append(f"    {fault['fault']} on {fault['worker']}: {fault['message']}")
            lines += [f"    log: {fault['log']}"] if fault.get("log") else []
    return "\n".join(lines)


def failures_text(kinds: Sequence[Mapping[str, Any]]) -> str:
    """A paragraph per kind of failure of `Farm.failures`, most frequent first, with up to five tasks."""
    if not kinds:
        return "no permanent failures"
    parts = []
    for kind in kinds:
        more = f" and {kind['n'] - 5} more" if kind["n"] > 5 else ""
        parts.append(
            f"{kind['n']} x {kind['fingerprint']}\n    {kind['example']}\n"
            f"    {' '.join(kind['tasks'][:5])}{more}\n    reproduce: {kind['command']}"
        )
    return "\n".join(parts)


def workers_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """One line per worker with its state ("?" for unreported fields), and the number of live ones."""
    if not rows:
        return "no workers"
    wide = 2 + max(len("version"), *(len(row.get("version", "?")) for row in rows))
    lines = [
        f"{'worker':<32}{'state':<10}{'seen':>8}{'slots':>6}{'memory':>14}  {'version':<{wide}}queues"
    ]
    for row in rows:
        refusal = f" refuses: {row['refuses']}" if row.get("refuses") else ""
        lines.append(
            f"{row['worker']:<32}{row['state']:<10}{duration_text(row['age_s']):>8}"
            f"{row.get('slots', '?'):>6}{memory_text(row):>14}  "
            f"{row.get('version', '?'):<{wide}}{row.get('queues', '')}{refusal}"
        )
    counts = Counter(row["state"] for row in rows)
    return "\n".join([*lines, ", ".join(f"{n} {state}" for state, n in sorted(counts.items()))])


def memory_text(row: Mapping[str, Any]) -> str:
    """ "3.2 of 15.6 GB" that a worker's processes hold of its machine; "-" when not known."""
    used, has = (float(row.get(name) or 0) / 1024 for name in ("memory_mb", "machine_mb"))
    return f"{used:.1f} of {has:.1f} GB" if used else "-"


def jobs_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """A job a line, oldest first."""
    if not rows:
        return "no jobs"
    lines = [
        f"{'job':<14}{'state':<20}{'priority':>8}  {'recipe':<10}{'houses':>13}{'views':>9}{'per h':>8}{'left':>8}"
        f"{'failed':>8}{'slot-h':>8}"
    ]
    for row in rows:
        houses = f"{row['houses_done']}/{row['houses']}"
        lines.append(
            f"{row['job']:<14}{row['state']:<20}{row['priority']:>8}  {row['recipe']:<10}{houses:>13}{row['views']:>9}"
            f"{row['views_per_h']:>8.0f}{duration_text(row['eta_s']):>8}{row['failed']:>8}"
            f"{row['slot_hours']:>8.2f}"
        )
    return "\n".join(lines)


def users_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """A user a line: his share, his quotas, what he uses."""
    if not rows:
        return "no users: the farm checks no tokens"
    lines = [f"{'user':<24}{'share':>7}{'running':>9}{'of':>7}{'slot-h':>9}{'of':>9}  may"]
    for row in rows:
        may = [name for name in ("admin", "preempt") if row[name]]
        lines.append(
            f"{row['user']:<24}{row['share']:>7g}{row['running']:>9}{row['max_slots'] or '-':>7}"
            f"{row['slot_hours_used']:>9.2f}{row['slot_hours'] or '-':>9}  {', '.join(may)}"
        )
    return "\n".join(lines)


def changes_text(rows: Sequence[Mapping[str, str]]) -> str:
    """A change a line, the newest first."""
    names = ("utc", "user", "from", "what", "of", "answer")
    lines = ("  ".join(row[name] or "-" for name in names) for row in rows)
    return "\n".join(lines) or "no changes"


def duration_text(seconds: float | None) -> str:
    """ "119s", "2.0m", "3.1h", "2.5d"; "-" when not known."""
    if seconds is None:
        return "-"
    # Each unit up to some multiple of it: 119 s, but 2 m.
    for unit, size, limit in (("s", 1, 120), ("m", 60, 120), ("h", 3600, 48)):
        if seconds < limit * size:
            value = seconds / size
            return f"{value:.1f}{unit}" if value < 10 else f"{value:.0f}{unit}"
    return f"{seconds / 86400:.1f}d"

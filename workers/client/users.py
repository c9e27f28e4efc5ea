"""The farm's users from outside: add, limit, remove, list. Effects: Redis, the store."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from pbrs_farm.core.errors import BadInput
from workers.ledger.task_ledger import User
from workers.ledger.user_table import known_user, new_user

if TYPE_CHECKING:
    from workers.client.farm_client import Farm


def limits_of(**given: Any) -> dict[str, Any]:
    """The given fields of a User for `change_user`, without None; BadInput for an invalid number."""
    limits = {name: value for name, value in given.items() if value is not None}
    for name in ("max_slots", "slot_hours"):
        if not 0 <= limits.get(name, 0) < math.inf:
            raise BadInput(f"--{name.replace('_', '-')}", limits[name], "expected 0 or more")
    if not 0 < limits.get("share", 1.0) < math.inf:
        raise BadInput("--share", limits["share"], "expected more than 0")
    return limits


def add_user(farm: Farm, name: str, limits: Mapping[str, Any]) -> str:
    """Let somebody ask the farm for work (the first is an admin); his token, which is kept nowhere."""
    farm.rights.check_admin("users add")
    farm.users.restore(farm.store)
    users = farm.users.all()
    if name in users:
        raise BadInput("users", name, "already exists", hint="see `users limit`")
    user, token = new_user(name, **{"is_admin": not users, **limits})
    _check_admin_left([*users.values(), user])
    farm.users.save({**users, name: user}, farm.store)
    farm.rights.note("users add", name, _said(limits))
    return token


def change_user(farm: Farm, name: str, limits: Mapping[str, Any]) -> None:
    """Another share or quota (`limits_of`), also for running jobs; BadInput if no admin would be left."""
    farm.rights.check_admin("users limit")
    if not limits:
        hint = "--share, --max-slots, --slot-hours, --admin, --may-preempt"
        raise BadInput("users limit", name, "nothing to change", hint=hint)
    users = farm.users.all()
    users[name] = replace(known_user(users, name), **limits)
    _check_admin_left(users.values())
    farm.users.save(users, farm.store)
    farm.rights.note("users limit", name, _said(limits))


def remove_user(farm: Farm, name: str) -> None:
    """Invalidate a user's token; jobs go on. BadInput for the only admin of several users."""
    farm.rights.check_admin("users remove")
    users = farm.users.all()
    del users[known_user(users, name).name]
    if users:
        _check_admin_left(users.values())
    farm.rights.note("users remove", name, "the user's jobs continue")
    farm.users.save(users, farm.store)


def user_rows(farm: Farm) -> list[dict[str, Any]]:
    """One row per user: share, quotas (0 = none), current slots, slot-hours of the last SPENT_DAYS."""
    users, spent = farm.users.all(), farm.users.spent_h()
    views = [farm.ledger.view(job) for job in farm.ledger.active_jobs()]
    return [
        {
            "user": user.name,
            "share": user.share,
            "running": int(sum(v.n_running for v in views if v is not None and v.user == name)),
            "max_slots": user.max_slots,
            "slot_hours": user.slot_hours,
            "slot_hours_used": round(spent.get(name, 0.0), 4),
            "admin": user.is_admin,
            "preempt": user.is_admin or user.may_preempt,
        }
        for name, user in users.items()
    ]


def _check_admin_left(users: Iterable[User]) -> None:
    if not any(user.is_admin for user in users):
        raise BadInput("users", "", "this is the last admin")


def _said(limits: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {value}" for name, value in limits.items()) or "no limits"

"""The Celery application: transport of messages. Effects: on import, reads the environment.

Celery transports tasks; the ledger decides whether they are done and whether they are retried. So there are
no results, no chords, no countdowns and no Celery retries. docs/farm/inside.md gives the reason for each
setting.
"""

from __future__ import annotations

import json
import signal
import ssl
from typing import Any, Final

from celery import Celery
from celery.signals import setup_logging, worker_init, worker_process_init
from kombu import Exchange, Queue
from kombu.serialization import register

from pbrs_farm.operating_system import die_with_parent
from pbrs_farm.store.s3 import forbid_in_this_process
from workers.config import FarmConfig, config_from_environment
from workers.ids import QUEUES
from workers.ledger.redis_connections import ANSWER_S
from workers.liveness import touch

MAX_MESSAGE: Final = 2048  # bytes
_VISIBILITY_S: Final = 6 * 3600  # a message unacknowledged for so long is delivered again
_TASK_LIMIT_S: Final = 5 * 3600  # above every deadline of a task, below the visibility


def _encode(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"))


def _decode(data: str | bytes) -> Any:
    if len(data) > MAX_MESSAGE:
        raise ValueError(f"a message of {len(data)} bytes; the maximum is {MAX_MESSAGE}")
    return json.loads(data)


# The only decoded content type: JSON of bounded size, never a pickle.
register(
    "pbrs-json", _encode, _decode, content_type="application/x-pbrs-json", content_encoding="utf-8"
)


# Reasons for each setting: docs/farm/inside.md.
_SETTINGS: Final[dict[str, Any]] = {
    "accept_content": ["pbrs-json"],
    "task_serializer": "pbrs-json",
    # Messages go to queues by name; nothing is declared when they are sent.
    "task_queues": [Queue(name, Exchange(name), routing_key=name) for name in QUEUES],
    "task_default_queue": QUEUES[0],
    "task_create_missing_queues": False,
    # No results: the ledger knows what became of a task.
    "task_ignore_result": True,
    "task_store_errors_even_if_ignored": False,
    # A message is acknowledged after its task: a killed worker's comes back.
    "task_acks_late": True,
    "task_reject_on_worker_lost": True,
    "task_acks_on_failure": True,
    "task_acks_on_timeout": True,
    "worker_prefetch_multiplier": 1,
    # The last resort only: the slot gives each task a shorter deadline.
    "task_time_limit": _TASK_LIMIT_S,
    "worker_send_task_events": False,
    "worker_enable_remote_control": False,
    "worker_hijack_root_logger": False,
    # A broker that comes back finds the workers still there.
    "worker_cancel_long_running_tasks_on_connection_loss": False,
    "broker_transport": "workers.queue.redis_transport:Transport",
    "broker_connection_retry_on_startup": True,
    "broker_connection_max_retries": None,
    "visibility_timeout": _VISIBILITY_S,
}
_TRANSPORT: Final[dict[str, Any]] = {
    "visibility_timeout": _VISIBILITY_S,
    "unacked_restore_interval": 10,
    "unacked_restore_throttle": 1,
    "socket_timeout": ANSWER_S,
    "socket_connect_timeout": 5,
    "socket_keepalive": True,
    "health_check_interval": ANSWER_S,
    "sep": ":",
    "client_name": "pbrs-celery",
}


def make_app(config: FarmConfig) -> Celery:
    """A Celery application for this farm, unconnected and not Celery's current one."""
    from workers.node.heartbeat import Heartbeat

    url = config.redis_url.reveal()
    app = Celery("pbrs_farm", broker=url, include=["workers.queue.task"], set_as_current=False)
    app.conf.update(_SETTINGS)
    app.conf.broker_transport_options = _TRANSPORT | {"global_keyprefix": config.prefix}
    # Redis over TLS: verify against the farm's own authority, else the system's.
    if url.startswith("rediss:"):
        ca = {"ssl_ca_certs": config.redis_ca} if config.redis_ca else {}
        app.conf.broker_use_ssl = {"ssl_cert_reqs": ssl.CERT_REQUIRED, **ca}
    app.steps["worker"].add(Heartbeat)
    return app


@worker_init.connect  # type: ignore[untyped-decorator]
def _keep_storage_out(**_: object) -> None:
    """Celery's parent process forks; obstore used before a fork hangs in every child."""
    forbid_in_this_process()


@worker_init.connect  # type: ignore[untyped-decorator]
def _forget_tasks_of_celery(**_: object) -> None:
    """Only ours is run: a message that names chords, backend_cleanup or another is rejected."""
    for name in [name for name in app.tasks if name.startswith("celery.")]:
        app.tasks.unregister(name)


@worker_init.connect  # type: ignore[untyped-decorator]
def _be_seen_alive_while_the_broker_is_away(**_: object) -> None:
    """Celery's loop blocks while it tries to connect, for longer than the liveness probe waits."""
    from workers.queue.redis_transport import Transport

    file = config_from_environment().heartbeat_file
    Transport.on_try = staticmethod(lambda: touch(file))


@worker_process_init.connect  # type: ignore[untyped-decorator]
def _leave_signals_to_the_parent(**_: object) -> None:
    """Slurm signals every process of a step: only the supervisor decides what TERM means."""
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    die_with_parent()


@setup_logging.connect  # type: ignore[untyped-decorator]
def _log_to_stderr(loglevel: int | str = "INFO", **_: object) -> None:
    from workers.logs import log_to_stderr

    log_to_stderr(loglevel)


app = make_app(config_from_environment())

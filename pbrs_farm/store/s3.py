"""A store in an S3 bucket of any vendor, through obstore. Effects: network.

obstore's runtime does not survive a fork: once a process has made a call, every call in its
children hangs forever, even through a new store. So this module remembers the first caller and
raises an error in its children, and Celery's parent process forbids itself all storage.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

from pbrs_farm.core.errors import (
    MachineFailed,
    ObjectMissing,
    StoreFailed,
    StoreRefused,
    StoreUnavailable,
)
from pbrs_farm.installation import install_command
from pbrs_farm.store.object_store import Head, check_key, check_prefix, content_type
from pbrs_farm.store.retrying import retry
from pbrs_farm.store.secret import Secret

T = TypeVar("T")
_LIST_CHUNK: Final = 1000  # maximum keys of one request in S3


@dataclass(frozen=True, slots=True)
class S3Settings:
    """Connection settings of an S3 store."""

    endpoint: str = ""
    region: str = "us-east-1"
    access_key: str = ""  # credentials: empty means the environment's own (AWS_*, IAM)
    secret_key: Secret = field(default_factory=Secret)
    session_token: Secret = field(default_factory=Secret)
    allow_http: bool = False
    path_style: bool = True  # https://endpoint/bucket/key, required by most vendors
    timeout_s: float = 120.0  # of one request
    retry_timeout_s: float = 60.0  # of one call with its retries


@dataclass(slots=True)
class ForkGuard:
    """Allows S3 calls in the first process that makes one, never in its children."""

    first_pid: int = 0  # the process that called first, 0 = none yet
    forbidden_pid: int = 0  # the process that must not call, 0 = none

    def enter(self, key: str) -> None:
        pid = os.getpid()
        if pid == self.forbidden_pid:
            raise StoreFailed(key, "this process forks workers, so it must not use storage")
        if self.first_pid and pid != self.first_pid:
            raise StoreFailed(
                key,
                f"process {self.first_pid} used S3 before it forked {pid}; obstore would hang here",
                hint="start the process with spawn, or use storage only in child processes",
            )
        self.first_pid = pid


_guard = ForkGuard()
_conditional: set[tuple[str, str]] = set()  # endpoint and bucket of proven conditional writes


def forbid_in_this_process() -> None:
    """Make every further S3 call of this process, which will fork, raise; children may call."""
    _guard.forbidden_pid = os.getpid()


class S3Store:
    """Objects below `s3://bucket/prefix`; every write is one PUT, if-absent is If-None-Match: *."""

    def __init__(self, bucket: str, prefix: str, settings: S3Settings) -> None:
        try:
            import obstore
            from obstore.store import S3Store as Client
        except ImportError:
            hint = install_command("s3")
            raise MachineFailed("s3:// needs the package obstore", hint=hint) from None
        self._bucket = bucket
        self._prefix = prefix.strip("/")
        self._settings = settings
        self._retry_timeout_s = settings.retry_timeout_s
        self._obstore: Any = obstore
        self.client: Any = Client(bucket, **_client_options(self._prefix, settings))

    @property
    def _place(self) -> tuple[str, str]:
        return self._settings.endpoint, self._bucket

    def __reduce__(self) -> tuple[object, ...]:
        # A spawned process makes a new client.
        return S3Store, (self._bucket, self._prefix, self._settings)

    @property
    def url(self) -> str:
        return f"s3://{self._bucket}/{self._prefix}" if self._prefix else f"s3://{self._bucket}"

    def put(self, key: str, data: bytes | memoryview) -> None:
        self._call(key, lambda _tries: self._put(key, data, "overwrite"))

    def put_if_absent(self, key: str, data: bytes) -> bool:
        def create(n_tries: int) -> bool:
            try:
                self._put(key, data, "create")
            except self._obstore.exceptions.AlreadyExistsError:
                # An earlier try may have succeeded although its response was lost.
                _conditional.add(self._place)
                return n_tries > 0 and bytes(self._obstore.get(self.client, key).bytes()) == data
            return True

        is_first = self._call(key, create)
        if is_first and self._place not in _conditional:
            self._call(key, lambda _tries: self._check_conditions(key, data))
        return is_first

    def _check_conditions(self, key: str, data: bytes) -> None:
        """Raise StoreRefused if the gateway creates an object that exists, as two writers would both be first.

        Called after the first create of a process. The object is created again, with equal bytes: twice,
        since another process may delete it in between.
        """
        for _ in range(2):
            try:
                self._put(key, data, "create")
            except self._obstore.exceptions.AlreadyExistsError:
                _conditional.add(self._place)
                return
        text = f"{self._settings.endpoint or self.url} ignores If-None-Match: writers overwrite each other"
        raise StoreRefused(key, text, hint="use a gateway with conditional writes, or a folder")

    def get(self, key: str) -> bytes:
        return self._call(key, lambda _tries: bytes(self._obstore.get(self.client, key).bytes()))

    def get_range(self, key: str, start: int, n_bytes: int) -> bytes:
        def part(_tries: int) -> bytes:
            return bytes(self._obstore.get_range(self.client, key, start=start, length=n_bytes))

        return self._call(key, part)

    def head(self, key: str) -> Head | None:
        try:
            meta = self._call(key, lambda _tries: self._obstore.head(self.client, key))
        except ObjectMissing:
            return None
        return Head(n_bytes=int(meta["size"]), modified_s=meta["last_modified"].timestamp())

    def list(self, prefix: str = "") -> Iterator[str]:
        check_prefix(prefix)
        return self._list(prefix)

    def delete(self, key: str) -> None:
        try:
            self._call(key, lambda _tries: self._obstore.delete(self.client, key))
        except ObjectMissing:
            return

    def _put(self, key: str, data: bytes | memoryview, mode: str) -> None:
        attributes = {"Content-Type": content_type(key)}
        # A multipart upload would not honour If-None-Match on every gateway (Ceph RGW 16).
        self._obstore.put(
            self.client, key, data, attributes=attributes, mode=mode, use_multipart=False
        )

    def _list(self, prefix: str) -> Iterator[str]:
        # Request keys page by page, so that each page is retried separately.
        last = ""
        while True:
            chunk = self._chunk(prefix, last)
            yield from chunk
            if len(chunk) < _LIST_CHUNK:
                return
            last = chunk[-1]

    def _chunk(self, prefix: str, after: str) -> tuple[str, ...]:
        options: dict[str, Any] = {"chunk_size": _LIST_CHUNK} | ({"offset": after} if after else {})

        def first_chunk(_tries: int) -> tuple[str, ...]:
            stream = self._obstore.list(self.client, prefix=prefix.rstrip("/") or None, **options)
            return tuple(str(entry["path"]) for entry in next(iter(stream), ()))

        return self._call(prefix.rstrip("/") or "root", first_chunk)

    def _call(self, key: str, act: Callable[[int], T]) -> T:
        """Call act(number of earlier tries) until it has no transient failure, with full jitter."""
        # Refuse before any network access.
        check_key(key)
        _guard.enter(key)

        def once(n_tries: int) -> T:
            try:
                return act(n_tries)
            except (self._obstore.exceptions.BaseError, OSError) as error:
                raise self._failure(key, error) from error

        return retry(once, self._retry_timeout_s)

    def _failure(self, key: str, error: Exception) -> StoreFailed:
        # Classify obstore's errors by the caller's remedy.
        kinds = self._obstore.exceptions
        text = " ".join(str(error).split())
        if isinstance(error, FileNotFoundError | kinds.NotFoundError):
            if "NoSuchBucket" in text:
                return StoreRefused(key, f"no bucket {self._bucket!r}")
            return ObjectMissing(key, f"no such object in {self.url}")
        if isinstance(error, kinds.UnauthenticatedError | kinds.PermissionDeniedError):
            return StoreRefused(key, f"{self.url} rejects these credentials", hint=_short(text))
        if isinstance(error, kinds.GenericError | OSError):
            return StoreUnavailable(key, f"{self.url} does not answer", hint=_short(text))
        return StoreFailed(key, f"{self.url}: {_short(text)}")


def _client_options(prefix: str, settings: S3Settings) -> dict[str, Any]:
    from datetime import timedelta

    options: dict[str, Any] = {
        "region": settings.region,
        "virtual_hosted_style_request": not settings.path_style,
        "client_options": {
            "timeout": timedelta(seconds=settings.timeout_s),
            "connect_timeout": timedelta(seconds=5),
            "allow_http": settings.allow_http,
        },
        # Retry in _call alone, so that retry_timeout_s is the only limit.
        "retry_config": {"max_retries": 1, "retry_timeout": timedelta(seconds=settings.timeout_s)},
    }
    # Omit empty values: obstore then reads the environment.
    secrets = {
        "prefix": prefix,
        "endpoint": settings.endpoint,
        "access_key_id": settings.access_key,
        "secret_access_key": settings.secret_key.reveal(),
        "session_token": settings.session_token.reveal(),
    }
    return options | {name: value for name, value in secrets.items() if value}


def _short(text: str) -> str:
    return text if len(text) <= 200 else text[:197] + "..."

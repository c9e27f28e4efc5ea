"""Settings from environment variables, read only by the command line and the workers.

Effects: reads environment variables and the files of secrets that they refer to.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from pbrs_farm.core.errors import BadInput
from pbrs_farm.regular_files import MAX_TEXT_BYTES, read_regular, text_from_bytes
from pbrs_farm.store.s3 import S3Settings
from pbrs_farm.store.secret import Secret
from pbrs_farm.store.url import StoreSettings

DEFAULT_REDIS: Final = "redis://127.0.0.1:6379/0"


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings from the environment."""

    store: StoreSettings = field(default_factory=StoreSettings)
    redis_url: Secret = field(default_factory=lambda: Secret(DEFAULT_REDIS))  # broker and ledger


def settings_from_environment(environment: Mapping[str, str] | None = None) -> Settings:
    """Settings from PBRS_* variables; NAME_FILE is the path of a file with NAME's value.

    PBRS_REDIS_URL, PBRS_S3_ENDPOINT, PBRS_S3_REGION, PBRS_S3_ACCESS_KEY, PBRS_S3_SECRET_KEY,
    PBRS_S3_ALLOW_HTTP (1), PBRS_FSYNC (1), PBRS_STORE_LAYOUT (files, packed). Raises BadInput
    if such a file cannot be read.
    """
    env = dict(os.environ if environment is None else environment)
    s3 = S3Settings(
        endpoint=value_or_file(env, "PBRS_S3_ENDPOINT"),
        region=value_or_file(env, "PBRS_S3_REGION") or "us-east-1",
        access_key=value_or_file(env, "PBRS_S3_ACCESS_KEY"),
        secret_key=Secret(value_or_file(env, "PBRS_S3_SECRET_KEY")),
        allow_http=value_or_file(env, "PBRS_S3_ALLOW_HTTP") == "1",
    )
    redis_url = value_or_file(env, "PBRS_REDIS_URL") or DEFAULT_REDIS
    return Settings(
        store=StoreSettings(
            fsync=value_or_file(env, "PBRS_FSYNC") == "1",
            s3=s3,
            layout=value_or_file(env, "PBRS_STORE_LAYOUT"),
        ),
        redis_url=Secret(redis_url),
    )


def value_or_file(environment: Mapping[str, str], name: str) -> str:
    """A variable's value, or the contents of the file NAME_FILE; "" if neither is set."""
    file = environment.get(f"{name}_FILE", "")
    if not file:
        return environment.get(name, "")
    try:
        return text_from_bytes(read_regular(Path(file), MAX_TEXT_BYTES)).strip()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(file, f"{name}_FILE", f"cannot be read: {error}") from None

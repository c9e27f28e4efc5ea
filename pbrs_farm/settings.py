"""Environment -> Settings; read by the command line and the workers only.

Effects: reads environment variables and, where they name one, files that hold a secret.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from pydantic import BaseModel, ConfigDict, SecretStr

from pbrs_farm.errors import BadInput
from pbrs_farm.store.s3 import S3Settings
from pbrs_farm.store.url import StoreSettings


class Settings(BaseModel):
    """What the environment says. redis_url: of the farm's broker and ledger."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    store: StoreSettings = StoreSettings()
    redis_url: SecretStr = SecretStr("redis://127.0.0.1:6379/0")


def settings_from_environment(environment: Mapping[str, str] | None = None) -> Settings:
    """Settings from PBRS_* variables; NAME_FILE gives the path of a file that holds NAME's value.

    PBRS_REDIS_URL, PBRS_S3_ENDPOINT, PBRS_S3_REGION, PBRS_S3_ACCESS_KEY, PBRS_S3_SECRET_KEY,
    PBRS_S3_ALLOW_HTTP (1), PBRS_FSYNC (1). Raises BadInput when such a file cannot be read.
    """
    env = dict(os.environ if environment is None else environment)
    s3 = S3Settings(
        endpoint=_value(env, "PBRS_S3_ENDPOINT"),
        region=_value(env, "PBRS_S3_REGION") or "us-east-1",
        access_key=_value(env, "PBRS_S3_ACCESS_KEY"),
        secret_key=SecretStr(_value(env, "PBRS_S3_SECRET_KEY")),
        allow_http=_value(env, "PBRS_S3_ALLOW_HTTP") == "1",
    )
    redis_url = _value(env, "PBRS_REDIS_URL") or "redis://127.0.0.1:6379/0"
    return Settings(
        store=StoreSettings(fsync=_value(env, "PBRS_FSYNC") == "1", s3=s3),
        redis_url=SecretStr(redis_url),
    )


def _value(environment: Mapping[str, str], name: str) -> str:
    file = environment.get(f"{name}_FILE", "")
    if not file:
        return environment.get(name, "")
    try:
        return Path(file).read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInput(file, f"{name}_FILE", f"cannot be read: {error}") from None

"""Stores in a real S3 bucket that the environment names."""

from __future__ import annotations

import os
import secrets
from dataclasses import replace

import pytest

from pbrs_farm.settings import settings_from_environment
from pbrs_farm.store import Store, store_from_url


def s3_store() -> Store:
    """A fresh prefix in the bucket that the environment names; skips without one."""
    endpoint = os.environ.get("PBRS_S3_ENDPOINT")
    if not endpoint:
        pytest.skip("PBRS_S3_ENDPOINT is not set")
    url = settings_from_environment().store
    settings = replace(url, s3=replace(url.s3, retry_timeout_s=5.0))
    bucket = os.environ.get("PBRS_S3_BUCKET", "pbrs")
    return store_from_url(f"s3://{bucket}/t-{secrets.token_hex(4)}", settings)

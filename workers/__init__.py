"""The farm: Celery carries the work, a ledger in Redis says what is done, storage is the truth."""

"""The farm: Celery transports tasks, a ledger in Redis tracks their state, storage is the truth."""

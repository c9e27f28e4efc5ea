"""The Celery application and its one task."""

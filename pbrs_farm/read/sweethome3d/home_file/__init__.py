"""A home file's bytes -> Plan: what it says, as values; nothing is built yet; no effects."""

"""The farm from outside: submit, watch, steer."""

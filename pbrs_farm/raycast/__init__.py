"""One ray caster: the source of every label and of the camera score; only mitsuba and drjit."""

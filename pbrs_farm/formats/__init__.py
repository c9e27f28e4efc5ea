"""One file per stored file, its writer beside its reader; no effects."""

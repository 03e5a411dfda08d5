"""Sweeps: many scenarios that differ in some values, each planned in a process of its own.

`spec` reads what is to be planned, `worker` plans cases, `pool` runs them on this machine and `cluster` on others, `results` writes tables
and a page, and `run` does all of it.
"""

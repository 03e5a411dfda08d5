"""Sweeps: many scenarios that differ in some values, each planned in a process of its own.

`spec` reads what is to be planned, `worker` plans one case, `pool` runs them, `results` writes tables and a page.
"""

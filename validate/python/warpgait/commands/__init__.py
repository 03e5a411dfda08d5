"""The commands of `warpgait` that are written in Python: `validate`, `export`, `view` and `sweep`, one module each."""

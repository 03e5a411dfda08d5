"""The page of `warpgait view`: what it shows (`scene`), how it is put together (`page`), and its parts in `assets`."""

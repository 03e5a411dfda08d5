#!/usr/bin/env python3
"""Makes stairs.png and stepping_stones.png: grounds with edges, 5.02 m x 2.42 m at 0.02 m per pixel, 16-bit gray.

Stairs (terrain.height_scale = 0.75): five steps up to a landing, 15 cm high and 30 cm deep; the first is at x = -0.7 m.
Stepping stones (terrain.height_scale = 0.53): between x = -1 m and x = 1 m the ground is 0.5 m deep, and stones stand in it, 26 to
30 cm long and wide, 10 to 14 cm apart, their tops up to 3 cm above or below the banks. The files are the same every time.

    python3 scenarios/data/make_grounds.py [FOLDER]      # writes both beside this script, or into FOLDER
"""

import random
import sys
from pathlib import Path

from png16 import WHITE, write_png

COLUMNS, ROWS = 251, 121  # x, y; the middle of the image is x = y = 0

# Lengths in pixels of 2 cm.
STEPS, RUN, FIRST_EDGE = 5, 15, 90
SHORE, PITCH, STONE, SHRINK = 75, 20, 15, 1  # columns of either bank; a stone's side is moved inward by 0 to SHRINK
# Lengths in m.
RISE = 0.15
DEPTH, UNEVEN = 0.50, 0.03
STONES_SCALE = DEPTH + UNEVEN  # from black to white

Gray = list[list[tuple[int]]]


def stairs() -> Gray:
    """Black below, white on the landing."""
    steps = [min(STEPS, max(0, (column - FIRST_EDGE) // RUN + 1)) for column in range(COLUMNS)]
    return [[(WHITE * step // STEPS,) for step in steps] for _ in range(ROWS)]


def stepping_stones(rng: random.Random) -> Gray:
    """Black between the stones."""

    def gray(height: float) -> tuple[int]:
        return (round(WHITE * (DEPTH + height) / STONES_SCALE),)

    pixels = [
        [gray(-DEPTH if SHORE <= column < COLUMNS - SHORE else 0.0) for column in range(COLUMNS)] for _ in range(ROWS)
    ]
    # The first stones are half a gap behind the bank, and a row of stones is in the middle.
    for left in range(SHORE + (PITCH - STONE) // 2, COLUMNS - SHORE - STONE, PITCH):
        for top in range(ROWS // 2 - STONE // 2 - 3 * PITCH, ROWS, PITCH):
            height = rng.uniform(-UNEVEN, UNEVEN)
            first_column, first_row = left + rng.randint(0, SHRINK), top + rng.randint(0, SHRINK)
            last_column, last_row = left + STONE - rng.randint(0, SHRINK), top + STONE - rng.randint(0, SHRINK)
            for row in range(max(0, first_row), min(ROWS, last_row)):
                pixels[row][first_column:last_column] = [gray(height)] * (last_column - first_column)
    return pixels


def main(folder: Path) -> None:
    """Write both images."""
    write_png(folder / "stairs.png", stairs())
    write_png(folder / "stepping_stones.png", stepping_stones(random.Random(2022)))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)

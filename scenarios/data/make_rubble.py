#!/usr/bin/env python3
"""Makes rubble.png: an artificial scan of a rubble field, with the defects of a real scan.

5.985 m x 3.99 m at 0.035 m per pixel, 16-bit gray + alpha, 0.40 m from black to white (terrain.spacing = 0.035,
terrain.height_scale = 0.40). The field has a step 9 cm high across the middle, tilted blocks 4 to 15 cm high with sharp
edges, and gravel. The scan has 3 mm of sensor noise, and no data (alpha 0) in the shadows that the blocks cast for a
scanner at the left and in a few stray pixels. The first and the last 0.8 m are flat except for the noise. The file is the
same every time.

    python3 scenarios/data/make_rubble.py [FOLDER]   # writes rubble.png beside this script, or into FOLDER
"""

import math
import random
import sys
from pathlib import Path

from png16 import WHITE, write_png

SPACING = 0.035  # m per pixel
COLUMNS, ROWS = 172, 115  # x, y
FULL_SCALE = 0.40  # m from black to white
BASE = 0.08  # m, added to the low ground so that no height is clipped
MARGIN = 0.80  # m without blocks at either end
BLOCKS, TRIES = 70, 4000  # number of blocks, and of random places that are tried for them
LEAST_DISTANCE = 0.30  # m between centers of blocks
HIGHEST_BLOCK = 0.15  # m
GRAVEL, GRAVEL_PITCH = 0.006, 3  # m, standard deviation of the bumps; pixels between the independent ones
GRAVEL_FADE = 0.2  # m over which the gravel fades out at the margins
STEP_AT, STEP_HEIGHT = 0.35, 0.09  # m, the curb: x of its edge, height
NOISE = 0.003  # m, standard deviation of the sensor
SCANNER = (-3.6, 0.0, 2.6)  # m, x, y and z of the scanner above the low ground
SHADOW = 1.2  # m, longer than any shadow
OCCLUSION = 0.005  # m: ground that rises above the line of sight by more hides a pixel
LOST = 0.004  # fraction of stray pixels without data


def curb(x: float, y: float) -> float:
    """Height of the ground under the blocks, m: low ground, a broken curb, a terrace, and a ramp down to the far margin."""
    edge = STEP_AT + 0.06 * math.sin(2.1 * y) + 0.03 * math.sin(7.3 * y + 1.0)
    ramp = min(1.0, max(0.0, (2.15 - x) / 0.9))
    return STEP_HEIGHT * ramp if x > edge else 0.0


def make_blocks(rng: random.Random) -> list[dict]:
    """Rectangles with a tilted top, whose centers are at least LEAST_DISTANCE apart."""
    half_x = 0.5 * SPACING * (COLUMNS - 1)
    half_y = 0.5 * SPACING * (ROWS - 1)
    blocks: list[dict] = []
    for _ in range(TRIES):
        x = rng.uniform(-half_x + MARGIN + 0.25, half_x - MARGIN - 0.25)
        y = rng.uniform(-half_y, half_y)
        if any(math.hypot(x - b["x"], y - b["y"]) < LEAST_DISTANCE for b in blocks):
            continue
        blocks.append(
            {
                "x": x,
                "y": y,
                "length": rng.uniform(0.10, 0.24),  # half sides, m
                "width": rng.uniform(0.06, 0.13),
                "turn": rng.uniform(0.0, math.pi),
                "height": 0.04 + 0.11 * rng.random() ** 2,  # mostly low
                "tilt": (rng.uniform(-0.15, 0.15), rng.uniform(-0.15, 0.15)),
            }
        )
        if len(blocks) == BLOCKS:
            break
    return blocks


def block_top(block: dict, x: float, y: float) -> float:
    """Height of the block's top above the ground at x, y, m; 0 beside it."""
    dx, dy = x - block["x"], y - block["y"]
    c, s = math.cos(block["turn"]), math.sin(block["turn"])
    u, v = c * dx + s * dy, c * dy - s * dx
    if abs(u) > block["length"] or abs(v) > block["width"]:
        return 0.0
    return max(0.0, min(HIGHEST_BLOCK, block["height"] + block["tilt"][0] * u + block["tilt"][1] * v))


def gravel(rng: random.Random) -> list[list[float]]:
    """Bumps of a few millimeters, correlated over about 0.1 m: random values on a coarse grid, interpolated bilinearly."""
    pitch = GRAVEL_PITCH
    coarse = [[rng.gauss(0.0, GRAVEL) for _ in range(COLUMNS // pitch + 2)] for _ in range(ROWS // pitch + 2)]
    field = []
    for row in range(ROWS):
        r, t = divmod(row, pitch)
        t /= pitch
        line = []
        for column in range(COLUMNS):
            c, s = divmod(column, pitch)
            s /= pitch
            low = coarse[r][c] * (1 - s) + coarse[r][c + 1] * s
            high = coarse[r + 1][c] * (1 - s) + coarse[r + 1][c + 1] * s
            line.append(low * (1 - t) + high * t)
        field.append(line)
    return field


def position(column: int, row: int) -> tuple[float, float]:
    """x, y of a pixel's center, m; row 0 has the largest y."""
    return SPACING * (column - 0.5 * (COLUMNS - 1)), -SPACING * (row - 0.5 * (ROWS - 1))


def is_hidden(heights: list[list[float]], column: int, row: int) -> bool:
    """Whether the ground hides the pixel from the scanner."""
    x, y = position(column, row)
    z = heights[row][column]
    dx, dy, dz = SCANNER[0] - x, SCANNER[1] - y, SCANNER[2] - z
    distance = math.hypot(dx, dy)
    for k in range(1, int(SHADOW / SPACING)):
        fraction = k * SPACING / distance
        c = round((x + fraction * dx) / SPACING + 0.5 * (COLUMNS - 1))
        r = round(-(y + fraction * dy) / SPACING + 0.5 * (ROWS - 1))
        if not (0 <= c < COLUMNS and 0 <= r < ROWS):
            return False
        if heights[r][c] > z + fraction * dz + OCCLUSION:
            return True
    return False


def main(folder: Path) -> None:
    """Write rubble.png."""
    rng = random.Random(2022)
    blocks = make_blocks(rng)
    bumps = gravel(rng)
    half_x = 0.5 * SPACING * (COLUMNS - 1)
    heights = []
    for row in range(ROWS):
        line = []
        for column in range(COLUMNS):
            x, y = position(column, row)
            inside = min(1.0, max(0.0, (half_x - MARGIN - abs(x)) / GRAVEL_FADE))
            top = max(block_top(block, x, y) for block in blocks)
            line.append(curb(x, y) + top + inside * bumps[row][column])
        heights.append(line)

    pixels = []
    for row in range(ROWS):
        line = []
        for column in range(COLUMNS):
            measured = BASE + heights[row][column] + rng.gauss(0.0, NOISE)
            lost = is_hidden(heights, column, row) or rng.random() < LOST
            gray = round(WHITE * min(1.0, max(0.0, measured / FULL_SCALE)))
            line.append((0, 0) if lost else (gray, WHITE))
        pixels.append(line)
    path = folder / "rubble.png"
    write_png(path, pixels)
    lost = sum(alpha == 0 for line in pixels for _, alpha in line)
    print(f"{path.name}: {COLUMNS} x {ROWS}, {len(blocks)} blocks, {lost} pixels without data")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)

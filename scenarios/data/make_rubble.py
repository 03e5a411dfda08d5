#!/usr/bin/env python3
"""Makes rubble.png: a made-up scan of a rubble field with the troubles of a real one.

5.985 m x 3.99 m at 0.035 m a pixel, 16-bit grey + alpha, 0.40 m from black to white (terrain.spacing = 0.035,
terrain.height_scale = 0.40). A step 9 cm high across the middle, tilted blocks 4 to 15 cm high with sharp edges, gravel,
3 mm of sensor noise, and no data (alpha 0) in the shadows that blocks throw for a scanner standing at the left, and in
stray pixels. The first and the last 0.8 m are flat but for the noise. The same file every time.

    python3 scenarios/data/make_rubble.py            # writes rubble.png beside this script
"""

import math
import random
import struct
import zlib
from pathlib import Path

SPACING = 0.035  # m a pixel
COLUMNS, ROWS = 172, 115  # x, y
FULL_SCALE = 0.40  # m from black to white
BASE = 0.08  # m, grey level of the low ground, so that nothing is clipped
MARGIN = 0.80  # m free of blocks at either end
STEP_AT, STEP_HEIGHT = 0.35, 0.09  # m, the kerb: x of its edge, height
NOISE = 0.003  # m, standard deviation of the sensor
SCANNER = (-3.6, 0.0, 2.6)  # x, y, z of the scanner over the low ground, m


def kerb(x: float, y: float) -> float:
    """Height of the ground under the blocks, m: low, a broken kerb, a terrace, a ramp down to the far margin."""
    edge = STEP_AT + 0.06 * math.sin(2.1 * y) + 0.03 * math.sin(7.3 * y + 1.0)
    ramp = min(1.0, max(0.0, (2.15 - x) / 0.9))
    return STEP_HEIGHT * ramp if x > edge else 0.0


def make_blocks(rng: random.Random) -> list[dict]:
    """Blocks as rectangles with a tilted top, spread so that no two centres are closer than 0.30 m."""
    half_x = 0.5 * SPACING * (COLUMNS - 1)
    half_y = 0.5 * SPACING * (ROWS - 1)
    blocks: list[dict] = []
    for _ in range(4000):
        x = rng.uniform(-half_x + MARGIN + 0.25, half_x - MARGIN - 0.25)
        y = rng.uniform(-half_y, half_y)
        if any(math.hypot(x - b["x"], y - b["y"]) < 0.30 for b in blocks):
            continue
        blocks.append(
            {
                "x": x,
                "y": y,
                "length": rng.uniform(0.10, 0.24),  # half sides, m
                "width": rng.uniform(0.06, 0.13),
                "turn": rng.uniform(0.0, math.pi),
                "height": 0.04 + 0.11 * rng.random() ** 2,  # mostly low, up to 0.15 m
                "tilt": (rng.uniform(-0.15, 0.15), rng.uniform(-0.15, 0.15)),
            }
        )
        if len(blocks) == 70:
            break
    return blocks


def block_top(block: dict, x: float, y: float) -> float:
    """Height of the block's top over the ground at x, y; 0 beside it."""
    dx, dy = x - block["x"], y - block["y"]
    c, s = math.cos(block["turn"]), math.sin(block["turn"])
    u, v = c * dx + s * dy, c * dy - s * dx
    if abs(u) > block["length"] or abs(v) > block["width"]:
        return 0.0
    return max(0.0, min(0.15, block["height"] + block["tilt"][0] * u + block["tilt"][1] * v))


def gravel(rng: random.Random) -> list[list[float]]:
    """Bumps of a few millimetres that are correlated over about 0.1 m: random values on a coarse grid, bilinear."""
    pitch = 3
    coarse = [[rng.gauss(0.0, 0.006) for _ in range(COLUMNS // pitch + 2)] for _ in range(ROWS // pitch + 2)]
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
    """x, y of a pixel's centre, m; row 0 is the largest y."""
    return SPACING * (column - 0.5 * (COLUMNS - 1)), -SPACING * (row - 0.5 * (ROWS - 1))


def is_hidden(heights: list[list[float]], column: int, row: int) -> bool:
    """Whether something stands between the pixel and the scanner."""
    x, y = position(column, row)
    z = heights[row][column]
    dx, dy, dz = SCANNER[0] - x, SCANNER[1] - y, SCANNER[2] - z
    distance = math.hypot(dx, dy)
    for k in range(1, int(1.2 / SPACING)):  # nothing here throws a longer shadow
        share = k * SPACING / distance
        c = round((x + share * dx) / SPACING + 0.5 * (COLUMNS - 1))
        r = round(-(y + share * dy) / SPACING + 0.5 * (ROWS - 1))
        if not (0 <= c < COLUMNS and 0 <= r < ROWS):
            return False
        if heights[r][c] > z + share * dz + 0.005:
            return True
    return False


def write_png(path: Path, grey_alpha: list[list[tuple[int, int]]]) -> None:
    """A 16-bit grey + alpha PNG without filters."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    lines = b"".join(b"\0" + b"".join(struct.pack(">HH", g, a) for g, a in line) for line in grey_alpha)
    header = struct.pack(">IIBBBBB", len(grey_alpha[0]), len(grey_alpha), 16, 4, 0, 0, 0)
    body = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(lines, 9)) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + body)


def main() -> None:
    rng = random.Random(2022)
    blocks = make_blocks(rng)
    bumps = gravel(rng)
    half_x = 0.5 * SPACING * (COLUMNS - 1)
    heights = []
    for row in range(ROWS):
        line = []
        for column in range(COLUMNS):
            x, y = position(column, row)
            inside = min(1.0, max(0.0, (half_x - MARGIN - abs(x)) / 0.2))  # gravel ends softly at the margins
            top = max(block_top(block, x, y) for block in blocks)
            line.append(kerb(x, y) + top + inside * bumps[row][column])
        heights.append(line)

    pixels = []
    for row in range(ROWS):
        line = []
        for column in range(COLUMNS):
            measured = BASE + heights[row][column] + rng.gauss(0.0, NOISE)
            lost = is_hidden(heights, column, row) or rng.random() < 0.004
            grey = round(65535 * min(1.0, max(0.0, measured / FULL_SCALE)))
            line.append((0, 0) if lost else (grey, 65535))
        pixels.append(line)
    path = Path(__file__).with_name("rubble.png")
    write_png(path, pixels)
    lost = sum(alpha == 0 for line in pixels for _, alpha in line)
    print(f"{path.name}: {COLUMNS} x {ROWS}, {len(blocks)} blocks, {lost} pixels without data")


if __name__ == "__main__":
    main()

"""Solo 8, whose legs have two joints, over ground: planned, and replayed."""

from pathlib import Path

import numpy as np
import pytest

from warpgait import Scenario, Terrain
from warpgait.validation import validate

"""Where tests find the checkout, and the material next to it that not every machine has."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared"
